#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "runtime/library/cardinal_basis.h"
#include "runtime/movement/movement.h"
#include "runtime/weights/correction.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

// Captured movements of equal parameters differ by manner. What their parameters have to do with
// them is a smooth function of these, which weights of the following kind make of the examples
// (universal kriging: Matheron 1969; Wahba's smoothing with a linear part that is not held back):
//
//   w(p) = R(p) r + A(p) a,   (R + ridge I) r + A a = I,   A^T r = 0,   R_j(p) = B(|p - p_j| / radius)
//
// with A and B as in CardinalBasisFit. They sum to 1, are right in the parameters (sum w_i p_i = p)
// and are not one-hot at the examples: the larger the ridge, the more of what is an example's own
// goes.
struct Smoothness {
  double ridge = 0.0;
  double radius = 0.0;  // of the kernel, in scales of the parameters
};

// Examples for each number that the linear part fits, below which manner cannot be told from
// parameters.
inline constexpr int kExamplesPerNumber = 4;

// A group whose weights are the smooth ones of some of its examples: the same motion, weights of
// the others 0.
struct SmoothGroup {
  std::vector<double> sites, dilations, linear, radial;
  MotionGroup group;  // spans into these; its sites are the examples used
};

// `examples`: those used. Null if the weights cannot be solved.
[[nodiscard]] std::unique_ptr<const SmoothGroup> FitSmooth(const MotionGroup& group,
                                                           std::span<const int> examples,
                                                           const Smoothness& smoothness);

// Sets the parameters and weights of a movement so that it is the smooth movement with `parameters`
// [d]. Returns false if it misses them by more than 0.1 mm. The weights are also in `scratch`.
[[nodiscard]] bool SetSmoothWeights(const SmoothGroup& smooth, std::span<const double> parameters,
                                    CorrectionScratch& scratch, Movement& movement);

// Of the movements of a group: <X_i, X_k> [n][n], X_i the joint positions of example i over its
// grid points; the mean over points and joints, so that <X_i - X_k, X_i - X_k> is a mean squared
// distance, square metres.
[[nodiscard]] std::vector<double> MovementProducts(const MotionGroup& group,
                                                   const GridLayout& layout,
                                                   const Skeleton& skeleton);

// By which the examples used are best made of each other: each is left out, its parameters are
// brought onto the grown hull of the rest as requests are, and the distance (root mean square,
// joint positions blended linearly) is summed. `products`: MovementProducts. None where there are
// too few examples to tell.
[[nodiscard]] std::optional<Smoothness> ChooseSmoothness(const MotionGroup& group,
                                                         std::span<const int> examples,
                                                         std::span<const double> products);

// Gives each of `examples`, which have the group's parameters and cells, the poses and times of the
// smooth movement of its parameters, made of all examples of the group; their parameters are
// measured again. None: they are as they were, since there are too few examples to tell manner from
// parameters. One that cannot be made within 0.1 mm stays as it is.
std::optional<Smoothness> SmoothExamples(const MotionGroup& group, const GridLayout& layout,
                                         const Skeleton& skeleton,
                                         std::vector<GridExample>& examples);

// The library's weights over smooth examples [count][d]: those of CardinalBasisFit, from three
// parameters on with radii up to 1.5 times as wide, as far as the sum of |w| stays within 2.4 (at
// samples; 2.5 is what kMaxCorrectedWeightSum allows) and the condition below 1000. In many
// dimensions the nearest of a few scattered sites is much nearer than most, and radii of that
// distance leave most of the hull to the linear part alone.
struct SmoothBasis {
  CardinalBasis basis;
  double radius_factor = 1.0;  // of the dilations
};
[[nodiscard]] Expected<SmoothBasis> FitOverSmooth(std::span<const double> sites,
                                                  std::span<const double> scales);

}  // namespace stridewire
