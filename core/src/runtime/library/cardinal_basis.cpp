#include "runtime/library/cardinal_basis.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace stridewire {
namespace {

// Matrices are row-major because the library file stores them that way.
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

double Distance(std::span<const double> a, std::span<const double> b,
                std::span<const double> scales) {
  double sum = 0.0;
  for (std::size_t l = 0; l < scales.size(); ++l) {
    const double difference = (a[l] - b[l]) / scales[l];
    sum += difference * difference;
  }
  return std::sqrt(sum);
}

bool AllFinite(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

// R_kj = B(|p_k - p_j| / d_j).
Matrix RadialMatrix(std::span<const double> sites, std::span<const double> dilations,
                    std::span<const double> scales) {
  const std::size_t d = scales.size();
  const std::size_t m = dilations.size();
  Matrix matrix(m, m);
  for (std::size_t k = 0; k < m; ++k) {
    for (std::size_t j = 0; j < m; ++j) {
      const double distance = Distance(sites.subspan(k * d, d), sites.subspan(j * d, d), scales);
      matrix(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j)) =
          CubicBSpline(distance / dilations[j]);
    }
  }
  return matrix;
}

double ConditionOf(const Eigen::PartialPivLU<Eigen::MatrixXd>& decomposition) {
  const double reciprocal = decomposition.rcond();
  return reciprocal > 0.0 ? 1.0 / reciprocal : HUGE_VAL;
}

}  // namespace

double CubicBSpline(double u) {
  if (u < 1.0) return 2.0 / 3.0 - u * u + 0.5 * u * u * u;
  if (u >= 2.0) return 0.0;
  const double v = 2.0 - u;
  return v * v * v / 6.0;
}

Expected<CardinalBasis> CardinalBasisFit::Run() const {
  const auto d = static_cast<std::size_t>(parameter_count);
  const auto n = static_cast<std::size_t>(example_count);
  if (parameter_count < 1 || example_count < 1 || sites.size() % d != 0 || scales.size() != d) {
    return Fail(ErrorCode::kShapeMismatch, "sites and scales do not fit the parameter count");
  }
  const std::size_t m = sites.size() / d;
  if (m < n || pseudo_weights.size() != (m - n) * n) {
    return Fail(ErrorCode::kShapeMismatch, "pseudoexample weights do not fit the sites");
  }
  if (!radius_factors.empty() && radius_factors.size() != m) {
    return Fail(ErrorCode::kShapeMismatch, "radius factors do not fit the sites");
  }
  for (const double factor : radius_factors) {
    if (!(factor > 0.0) || !std::isfinite(factor)) {
      return Fail(ErrorCode::kOutOfRange, "a radius factor is not positive");
    }
  }
  if (!AllFinite(sites) || !AllFinite(pseudo_weights)) {
    return Fail(ErrorCode::kOutOfRange, "a parameter or a weight is not finite");
  }
  for (const double scale : scales) {
    if (!(scale > 0.0) || !std::isfinite(scale)) {
      return Fail(ErrorCode::kOutOfRange, "a parameter's scale is not positive");
    }
  }

  CardinalBasis basis;
  basis.parameter_count = parameter_count;
  basis.example_count = example_count;
  basis.scales.assign(scales.begin(), scales.end());
  basis.sites.assign(sites.begin(), sites.end());
  basis.centres.assign(d, 0.0);
  for (std::size_t e = 0; e < n; ++e) {
    for (std::size_t l = 0; l < d; ++l)
      basis.centres[l] += sites[e * d + l] / static_cast<double>(n);
  }
  const auto site = [&](std::size_t s) { return sites.subspan(s * d, d); };

  basis.dilations.assign(m, 1.0);
  for (std::size_t j = 0; j < m; ++j) {
    double nearest_any = HUGE_VAL;
    double nearest = HUGE_VAL;
    for (std::size_t k = 0; k < m; ++k) {
      if (k == j) continue;
      const double distance = Distance(site(j), site(k), scales);
      nearest_any = std::min(nearest_any, distance);
      if (k < n || j >= n || radii_from_all_sites) nearest = std::min(nearest, distance);
    }
    if (nearest_any < kMinSiteDistance) {
      return Fail(ErrorCode::kIllConditioned, "two examples have the same parameters",
                  static_cast<std::int64_t>(j));
    }
    if (std::isfinite(nearest)) basis.dilations[j] = nearest;
    if (!radius_factors.empty()) basis.dilations[j] *= radius_factors[j];
  }

  // Solves A a = D in the least-squares sense and then R r = D - A a, where D (`wanted`) contains
  // the prescribed weights at the sites.
  Matrix a_matrix(m, d + 1);
  Matrix wanted = Matrix::Zero(static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(n));
  for (std::size_t k = 0; k < m; ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    a_matrix(row, 0) = 1.0;
    for (std::size_t l = 0; l < d; ++l) {
      a_matrix(row, static_cast<Eigen::Index>(l + 1)) = (site(k)[l] - basis.centres[l]) / scales[l];
    }
    for (std::size_t e = 0; e < n; ++e) {
      wanted(row, static_cast<Eigen::Index>(e)) =
          k < n ? (k == e ? 1.0 : 0.0) : pseudo_weights[(k - n) * n + e];
    }
  }
  const Matrix r_matrix = RadialMatrix(sites, basis.dilations, scales);
  // If the examples do not span every direction, the solution of minimum norm is used. A complete
  // orthogonal decomposition finds it as an SVD would, and compiles in a fraction of the time.
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> a_decomposition;
  a_decomposition.setThreshold(1e-9);
  a_decomposition.compute(a_matrix);
  const Matrix linear = a_decomposition.solve(wanted);
  const Eigen::PartialPivLU<Eigen::MatrixXd> r_decomposition(r_matrix);
  const Matrix radial = r_decomposition.solve(wanted - a_matrix * linear);

  basis.condition = ConditionOf(r_decomposition);
  if (!(basis.condition <= kMaxCondition)) {
    return Fail(ErrorCode::kIllConditioned, "the radial basis is nearly singular");
  }
  basis.linear.assign(linear.data(), linear.data() + linear.size());
  basis.radial.assign(radial.data(), radial.data() + radial.size());
  if (!AllFinite(basis.linear) || !AllFinite(basis.radial)) {
    return Fail(ErrorCode::kIllConditioned, "the weights have no finite solution");
  }
  return basis;
}

double RadialCondition(std::span<const double> sites, std::span<const double> dilations,
                       std::span<const double> scales) {
  return ConditionOf(Eigen::PartialPivLU<Eigen::MatrixXd>(RadialMatrix(sites, dilations, scales)));
}

void EvaluateWeights(const ConstBasisSpan& basis, std::span<const double> parameters,
                     std::span<double> weights) {
  const std::size_t d = parameters.size();
  const std::size_t n = weights.size();
  for (std::size_t e = 0; e < n; ++e) weights[e] = basis.linear[e];
  for (std::size_t l = 0; l < d; ++l) {
    const double a = (parameters[l] - basis.centres[l]) / basis.scales[l];
    const double* row = &basis.linear[(l + 1) * n];
    for (std::size_t e = 0; e < n; ++e) weights[e] += a * row[e];
  }
  for (std::size_t j = 0; j < basis.dilations.size(); ++j) {
    const double value = CubicBSpline(
        Distance(parameters, basis.sites.subspan(j * d, d), basis.scales) / basis.dilations[j]);
    if (value == 0.0) continue;
    const double* row = &basis.radial[j * n];
    for (std::size_t e = 0; e < n; ++e) weights[e] += value * row[e];
  }
}

}  // namespace stridewire
