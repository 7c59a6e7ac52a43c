#pragma once

#include <span>
#include <vector>

#include "stridewire/base/error.h"

namespace stridewire {

/// Cubic B-spline kernel: B(u) = 2/3 - u^2 + u^3/2 for u < 1, (2 - u)^3 / 6 for 1 <= u < 2, and 0
/// for u >= 2.
[[nodiscard]] double CubicBSpline(double u);

/// Weights by cardinal basis functions (Sloan, Rose, Cohen 2001; paper, Section 3). A linear part
/// is fitted by least squares, and radial functions correct the remaining error at every site:
///
///   w_i(p) = sum_l a_il A_l(p) + sum_j r_ij R_j(p),   A_0 = 1,  A_l = (p_l - centre_l) / scale_l
///   R_j(p) = B(|p - p_j| / d_j),  d_j = dilation of site j
///
/// The weights sum to 1 everywhere. At an example, its own weight is 1 and all others are 0.
/// Elsewhere usually all weights are nonzero, because the linear part does not vanish.
struct CardinalBasis {
  int parameter_count = 0;        ///< d >= 1
  int example_count = 0;          ///< n >= 1
  std::vector<double> centres;    ///< [d]
  std::vector<double> scales;     ///< [d], > 0
  std::vector<double> sites;      ///< [site][d]: parameters of the sites, in metres and radians.
  std::vector<double> dilations;  ///< [site]: d_j in scaled parameters (CardinalBasisFit::Run).
  std::vector<double> linear;     ///< [1 + d][n]
  std::vector<double> radial;     ///< [site][n]
  double condition = 1.0;         ///< Condition number of R, estimated in the 1-norm.
};

/// A borrowed view of the parts of a basis that evaluation needs.
struct ConstBasisSpan {
  std::span<const double> centres, scales, sites, dilations, linear, radial;
};

/// Minimum distance between two sites after scaling. Callers must merge closer sites.
inline constexpr double kMinSiteDistance = 1e-4;
/// CardinalBasisFit::Run fails if the condition number of R is larger.
inline constexpr double kMaxCondition = 1e6;

/// Input for fitting a CardinalBasis to examples and pseudoexamples (Run). Borrows its spans.
struct CardinalBasisFit {
  int parameter_count = 0;
  int example_count = 0;
  /// [site][d]: parameters of the examples, followed by those of the pseudoexamples.
  std::span<const double> sites;
  std::span<const double> pseudo_weights;  ///< [site - n][n]: weights of the pseudoexamples.
  std::span<const double> scales;          ///< [d], > 0
  /// [site]: factors by which the dilations are multiplied, > 0. Empty: all factors are 1.
  std::span<const double> radius_factors;
  /// True: every dilation is the distance to the nearest other site, whether example or
  /// pseudoexample, as in the paper.
  bool radii_from_all_sites = false;

  /// Fits the basis.
  ///
  /// The centre of a parameter is its mean over the *examples*. Parameters are centred so that the
  /// weights sum to 1 away from the sites even if the examples do not span all parameters. The
  /// dilation of an example is the distance to the nearest other example, that of a pseudoexample
  /// the distance to the nearest site. If examples used the nearest site as well, every added
  /// pseudoexample would shrink their radii. The least-squares solution has minimum norm. In its
  /// decomposition, pivots below 1e-9 of the largest one count as zero.
  ///
  /// Errors: kShapeMismatch if the sizes of the spans do not match. kOutOfRange if a number is not
  /// finite, or if a scale or radius factor is not positive. kIllConditioned if two sites are
  /// closer than kMinSiteDistance (Error::index is the site), if the condition number of R is above
  /// kMaxCondition, or if a coefficient is not finite.
  [[nodiscard]] Expected<CardinalBasis> Run() const;
};

/// Returns the condition number of R, with R_kj = B(|p_k - p_j| / d_j), estimated in the 1-norm.
/// Returns HUGE_VAL if R is singular.
[[nodiscard]] double RadialCondition(std::span<const double> sites,
                                     std::span<const double> dilations,
                                     std::span<const double> scales);

/// Writes the weights at `parameters` [d] to `weights` [n]. Never allocates.
void EvaluateWeights(const ConstBasisSpan& basis, std::span<const double> parameters,
                     std::span<double> weights);

}  // namespace stridewire
