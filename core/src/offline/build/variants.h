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

// Returns the captured steps that become variants of a group (see MotionGroup), as indices of
// `found`. They are at most kStoredVariants: those whose parameters are nearest to the medians over
// all steps. `found` are the captured steps with aligned hemispheres, and `used` [found] is how the
// builder used them. `units` are metres per unit of each parameter.
//
// Outliers are never variants. If the examples are not smooth, steps that are stored unchanged are
// not variants either, because the library already blends them for their parameters. Only groups
// with one or two parameters, that is, straight steps, have variants. In other groups, they made no
// visible difference, because steps of a walk with turns rarely have similar parameters.
[[nodiscard]] std::vector<std::size_t> ChooseVariants(const std::vector<GridExample>& found,
                                                      std::span<const SelectedExample> used,
                                                      std::span<const double> units,
                                                      bool is_smooth);

// Returns the times of a captured step, in seconds, that correspond to the grid points of what the
// group blends for its parameters: those at which its root has covered the same fraction of its way
// past the standing foot. A variant that is resampled at these times moves the body forward like
// the blend. At other times, it would change the speed of the body, and each join with another step
// would have to brake or accelerate it. Returns the times of the step's own grid points if a root
// does not always move forward. `group` must have weights.
[[nodiscard]] std::vector<double> TimesOfBlend(const MotionGroup& group, const GridLayout& layout,
                                               const Skeleton& skeleton,
                                               const GridExample& captured);

// Adapts a variant to what the group blends for its parameters:
//
// - The variant gets the keytimes of the blend. If a varied step had other keytimes, short
//   intervals would be played much faster.
// - The root is moved sideways, proportionally to the grid point, so that it ends where that of the
//   blend ends. Otherwise, the differences would add up, and walks would leave their line.
//
// `group` must have weights.
void AdaptToBlend(const MotionGroup& group, const GridLayout& layout, GridExample& variant);

}  // namespace stridewire
