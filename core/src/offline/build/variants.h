#pragma once

#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

// Maximum number of variants that the builder stores per group. More variants do not make strides
// vary more, but each pose is a sum over all of them.
inline constexpr std::size_t kStoredVariants = 4;

// Toe tips of variants stay this much higher above the ground than those of examples (see
// ToeBender::Bend). A varied step adds the difference between a variant and the blend for its
// parameters to another blend, in which the toes may be lower at the same time.
inline constexpr double kVariantToeMarginM = 0.015;

// Returns the indices in `found` of the captured steps that become variants of a group (see
// MotionGroup): the steps whose parameters are nearest to the medians over all steps, at most
// kStoredVariants. `found` contains the captured steps with aligned hemispheres, and `used` [found]
// describes how the builder used them. `units` contains metres per unit of each parameter.
//
// Outliers are never variants. If the examples are not smooth, steps that are stored unchanged are
// not variants either, because the library already blends them for their parameters. Only groups
// with one or two parameters, that is, straight steps, have variants. In other groups, they made no
// visible difference, because steps of a walk with turns rarely have similar parameters.
[[nodiscard]] std::vector<std::size_t> ChooseVariants(const std::vector<GridExample>& found,
                                                      std::span<const SelectedExample> used,
                                                      std::span<const double> units,
                                                      bool is_smooth);

// Returns the times at which to sample a captured step, one per grid point, in seconds. They align
// the step with the group's blend for the same parameters: at each grid point, both roots have
// covered the same fraction of their paths past the standing foot. A variant sampled at other times
// would change the speed of the body, and each transition to another step would have to brake or
// accelerate it. If one of the roots does not move forward throughout, returns the times of the
// step's own grid points. `group` must have weights.
[[nodiscard]] std::vector<double> TimesOfBlend(const MotionGroup& group, const GridLayout& layout,
                                               const Skeleton& skeleton,
                                               const GridExample& captured);

// Adapts a variant to the group's blend for its parameters:
//
// - The variant gets the keytimes and the heading change of the blend. If a varied step had other
//   keytimes, short intervals would be played much faster.
// - The root is moved sideways, in proportion to the index of the grid point, so that it ends where
//   that of the blend ends. Otherwise, the differences would add up, and walks would leave their
//   line.
//
// `group` must have weights.
void AdaptToBlend(const MotionGroup& group, const GridLayout& layout, GridExample& variant);

}  // namespace stridewire
