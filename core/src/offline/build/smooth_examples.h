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

// Captured movements with equal parameters differ by individual variation. The part that depends on
// the parameters is a smooth function of them. It is a blend of the examples with the following
// weights (universal kriging, Matheron 1969; equivalent to Wahba's smoothing with an unpenalised
// linear part):
//
//   w(p) = R(p) r + A(p) a,   (R + ridge I) r + A a = I,   A^T r = 0,
//   R_j(p) = B(|p - p_j| / radius)
//
// with A and B as in CardinalBasisFit. The weights sum to 1 and reproduce the parameters (sum w_i
// p_i = p). At an example, the weights of the other examples are not 0. A larger ridge removes more
// individual variation.
struct Smoothness {
  double ridge = 0.0;
  double radius = 0.0;  // Radius of the kernel, in units of Parameter::scale.
};

// Minimum number of examples per coefficient of the linear part for smoothing. With fewer examples,
// smoothing could not separate individual variation from the influence of the parameters.
inline constexpr int kExamplesPerCoefficient = 4;

// A group with the smooth weights of some of its examples. It stores the motion of all examples,
// but the weights of the others are 0.
struct SmoothGroup {
  std::vector<double> sites, dilations, linear, radial;
  // A copy of the group whose sites are the examples used. Its sites, dilations, linear and radial
  // refer to the vectors above. Its other spans refer to the data of the original group.
  MotionGroup group;
};

// Fits smooth weights to `examples`. Returns null if they cannot be solved.
[[nodiscard]] std::unique_ptr<const SmoothGroup> FitSmooth(const MotionGroup& group,
                                                           std::span<const int> examples,
                                                           const Smoothness& smoothness);

// Sets group, parameters and weights of `movement` to the smooth movement with `parameters` [d].
// Returns false if that movement misses the parameters by more than 0.1 mm. Writes the weights to
// `scratch`.
[[nodiscard]] bool SetSmoothWeights(const SmoothGroup& smooth, std::span<const double> parameters,
                                    CorrectionScratch& scratch, Movement& movement);

// Returns the inner products <X_i, X_k> [n][n] of the movements of a group, in square metres. X_i
// are the joint positions of example i over its grid points. The products are means over points and
// joints, so <X_i - X_k, X_i - X_k> is the mean squared distance.
[[nodiscard]] std::vector<double> MovementProducts(const MotionGroup& group,
                                                   const GridLayout& layout,
                                                   const Skeleton& skeleton);

// Chooses the smoothness with which the examples reproduce each other best. Each example is blended
// from the others, at its own parameters, projected onto the enlarged hull of the others as for
// requests. The error is the root mean square distance between the linearly blended joint positions
// and those of the example. The smoothness with the smallest sum of errors is chosen. `products`:
// see MovementProducts. Returns nullopt if there are too few examples or no weights can be solved.
[[nodiscard]] std::optional<Smoothness> ChooseSmoothness(const MotionGroup& group,
                                                         std::span<const int> examples,
                                                         std::span<const double> products);

// Replaces the poses and times of `examples` with those of the smooth movements with the same
// parameters. These movements are blends of all examples of the group. Their parameters are
// measured again. `examples` must have the parameters and cells of the group.
//
// Returns nullopt and changes nothing if there are too few examples, or if the weights cannot be
// solved. An example whose parameters cannot be reproduced within 0.1 mm remains unchanged.
std::optional<Smoothness> SmoothExamples(const MotionGroup& group, const GridLayout& layout,
                                         const Skeleton& skeleton,
                                         std::vector<GridExample>& examples);

// The result of FitSmoothBasis.
struct SmoothBasis {
  CardinalBasis basis;
  double radius_factor = 1.0;  // Factor by which the dilations are multiplied.
};

// Fits the weights of a library to smooth examples [count][d] with CardinalBasisFit. With three or
// more parameters, the radii are multiplied by up to 1.5, as long as the sum of |w| at samples
// stays within 2.4 (kMaxCorrectedWeightSum allows 2.5) and the condition number below 1000. Wider
// radii are necessary because a small number of sites is sparse in a space of many dimensions. If
// each radius were the distance to the nearest site, only the linear part would act in most of the
// hull.
[[nodiscard]] Expected<SmoothBasis> FitSmoothBasis(std::span<const double> sites,
                                                   std::span<const double> scales);

}  // namespace stridewire
