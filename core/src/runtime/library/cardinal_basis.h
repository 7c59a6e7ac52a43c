#pragma once

#include <span>
#include <vector>

#include "stridewire/base/error.h"

namespace stridewire {

/// Cubic B-spline kernel: B(u) = 2/3 - u^2 + u^3/2 (u < 1), (2 - u)^3 / 6 (1 <= u < 2), 0 beyond.
[[nodiscard]] double CubicBSpline(double u);

/// Weights by cardinal basis functions (Sloan, Rose, Cohen 2001; paper, Section 3): a linear
/// part fitted by least squares plus radial functions that take up the rest at every site,
///
///   w_i(p) = sum_l a_il A_l(p) + sum_j r_ij R_j(p),   A_0 = 1,  A_l = (p_l - centre_l) / scale_l
///   R_j(p) = B(|p - p_j| / d_j),  d_j = distance from site j to the nearest other site
///
/// The weights sum to 1 everywhere, are one-hot at the examples, and are dense: the linear part
/// does not vanish anywhere.
struct CardinalBasis {
  int parameter_count = 0;        ///< d >= 1
  int example_count = 0;          ///< n >= 1
  std::vector<double> centres;    ///< [d]
  std::vector<double> scales;     ///< [d], > 0
  std::vector<double> sites;      ///< [site][d], physical units
  std::vector<double> dilations;  ///< [site], scaled units
  std::vector<double> linear;     ///< [1 + d][n]
  std::vector<double> radial;     ///< [site][n]
  double condition = 1.0;         ///< Of R, estimated in the 1-norm.
};

/// A borrowed basis; what evaluation needs.
struct ConstBasisSpan {
  std::span<const double> centres, scales, sites, dilations, linear, radial;
};

inline constexpr double kMinSiteDistance = 1e-4;  ///< Scaled; nearer sites must be merged first.
inline constexpr double kMaxCondition = 1e6;

struct CardinalBasisFit {
  int parameter_count = 0;
  int example_count = 0;
  std::span<const double> sites;           ///< [site][d]: examples, then pseudoexamples
  std::span<const double> pseudo_weights;  ///< [site - n][n]
  std::span<const double> scales;          ///< [d], > 0
  std::span<const double> radius_factors;  ///< [site], > 0: of dilations; empty: all 1
  /// Every dilation from the nearest other site of either sort, as the paper has it.
  bool radii_from_all_sites = false;

  /// Centre of parameter l = its mean over the *examples*: under rank deficiency the weights sum to 1
  /// off the sites only if parameters are centred. Dilations come from the example sites alone (for
  /// an example: the nearest other example; for a pseudoexample: the nearest site), as
  /// refinement would otherwise shrink every radius. Least squares by complete orthogonal decomposition
  /// (minimum norm), relative cut 1e-9.
  ///
  /// kShapeMismatch; kOutOfRange: a number not finite; kIllConditioned: two sites nearer than
  /// kMinSiteDistance (index: the site), or the condition of R above kMaxCondition.
  [[nodiscard]] Expected<CardinalBasis> Run() const;
};

/// Condition of R, R_kj = B(|p_k - p_j| / d_j), estimated in the 1-norm; HUGE_VAL if singular.
[[nodiscard]] double RadialCondition(std::span<const double> sites,
                                     std::span<const double> dilations,
                                     std::span<const double> scales);

/// Weights at `parameters` [d] into `weights` [n]. Double throughout; never allocates.
void EvaluateWeights(const ConstBasisSpan& basis, std::span<const double> parameters,
                     std::span<double> weights);

}  // namespace stridewire
