#include "offline/build/smooth_examples.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "offline/build/hull_survey.h"
#include "offline/build/parameter_scales.h"
#include "offline/build/pose_error.h"
#include "runtime/library/convex_hull.h"
#include "runtime/library/keytimes.h"
#include "runtime/plan/request_plan.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/correction.h"
#include "runtime/weights/measure.h"

namespace stridewire {
namespace {

constexpr std::array kRadii = {2.0, 3.0};
constexpr std::array kRidges = {0.03, 0.1, 0.3, 1.0, 3.0, 10.0};
constexpr double kSmallestReciprocalCondition = 1e-9;

constexpr int kSolveIterations = 20;
constexpr double kMaxMissM = 1e-4;

constexpr std::size_t kWideFromParameters = 3;
constexpr std::array kWideRadii = {1.5, 1.4, 1.3, 1.2, 1.1};
constexpr double kWideCondition = 1000.0;
constexpr double kWideWeightSum = 2.4;
constexpr int kWideSamples = 1000;
constexpr std::uint32_t kWideSeed = 1;

std::vector<double> SitesOf(const MotionGroup& group, std::span<const int> examples) {
  std::vector<double> sites;
  for (const int e : examples) {
    const std::span<const double> site = group.site(e);
    sites.insert(sites.end(), site.begin(), site.end());
  }
  return sites;
}

// Solves the equations of Smoothness. `inverse` is the inverse of [R + ridge I, A; A^T, 0], where R
// and A contain one row per site: R(p) and A(p) at the site. The first columns of the inverse, one
// per site, contain r in their upper rows and a in the rows below.
struct Kriging {
  std::vector<double> sites;  // [site][d]
  std::vector<double> scales;
  std::vector<double> centres;
  Eigen::MatrixXd inverse;
  double radius;
  bool is_valid = false;

  Kriging(std::vector<double> of_sites, std::vector<double> of_scales, const Smoothness& smoothness)
      : sites(std::move(of_sites)),
        scales(std::move(of_scales)),
        centres(scales.size(), 0.0),
        radius(smoothness.radius) {
    const std::size_t d = scales.size();
    const std::size_t m = sites.size() / d;
    for (std::size_t i = 0; i < sites.size(); ++i) {
      centres[i % d] += sites[i] / static_cast<double>(m);
    }
    const auto size = static_cast<Eigen::Index>(m + d + 1);
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size, size);
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(m); ++i) {
      const Eigen::VectorXd row =
          Functions(std::span(sites).subspan(static_cast<std::size_t>(i) * d, d));
      matrix.row(i) = row;
      matrix.col(i) = row;
    }
    matrix.diagonal().head(static_cast<Eigen::Index>(m)).array() += smoothness.ridge;
    const Eigen::PartialPivLU<Eigen::MatrixXd> decomposition(matrix);
    if (!(decomposition.rcond() > kSmallestReciprocalCondition)) return;
    inverse = decomposition.inverse();
    is_valid = inverse.allFinite();
  }

  // Returns R(p) followed by A(p).
  [[nodiscard]] Eigen::VectorXd Functions(std::span<const double> p) const {
    const std::size_t d = scales.size();
    const std::size_t m = sites.size() / d;
    Eigen::VectorXd functions(static_cast<Eigen::Index>(m + d + 1));
    for (std::size_t i = 0; i < m; ++i) {
      double sum = 0.0;
      for (std::size_t l = 0; l < d; ++l) {
        const double difference = (p[l] - sites[i * d + l]) / scales[l];
        sum += difference * difference;
      }
      functions(static_cast<Eigen::Index>(i)) = CubicBSpline(std::sqrt(sum) / radius);
    }
    functions(static_cast<Eigen::Index>(m)) = 1.0;
    for (std::size_t l = 0; l < d; ++l) {
      functions(static_cast<Eigen::Index>(m + 1 + l)) = (p[l] - centres[l]) / scales[l];
    }
    return functions;
  }

  // Returns the weights [site] at p without site `left_out`. By block inversion, the inverse of the
  // matrix without that site's row and column is the full inverse minus the product of that column
  // and row of the inverse, divided by their common element.
  [[nodiscard]] Eigen::VectorXd WeightsWithout(Eigen::Index left_out,
                                               std::span<const double> p) const {
    Eigen::VectorXd functions = Functions(p);
    functions(left_out) = 0.0;
    const Eigen::VectorXd all = inverse * functions;
    const Eigen::VectorXd weights =
        all - inverse.col(left_out) * (all(left_out) / inverse(left_out, left_out));
    return weights.head(static_cast<Eigen::Index>(sites.size() / scales.size()));
  }
};

}  // namespace

std::unique_ptr<const SmoothGroup> FitSmooth(const MotionGroup& group,
                                             std::span<const int> examples,
                                             const Smoothness& smoothness) {
  const Kriging kriging(SitesOf(group, examples), ScalesOf(group), smoothness);
  if (!kriging.is_valid) return nullptr;
  const std::size_t d = group.parameters.size();
  const std::size_t m = examples.size();
  const auto n = static_cast<std::size_t>(group.example_count);
  auto smooth = std::make_unique<SmoothGroup>();
  smooth->sites = kriging.sites;
  smooth->dilations.assign(m, smoothness.radius);
  smooth->radial.assign(m * n, 0.0);
  smooth->linear.assign((d + 1) * n, 0.0);
  for (std::size_t i = 0; i < m; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const auto e = static_cast<std::size_t>(examples[i]);
    STRIDEWIRE_CHECK(e < n);
    for (std::size_t j = 0; j < m; ++j) {
      smooth->radial[j * n + e] = kriging.inverse(static_cast<Eigen::Index>(j), column);
    }
    for (std::size_t l = 0; l <= d; ++l) {
      smooth->linear[l * n + e] = kriging.inverse(static_cast<Eigen::Index>(m + l), column);
    }
  }
  smooth->group = group;
  smooth->group.sites = smooth->sites;
  smooth->group.site_count = static_cast<int>(m);
  smooth->group.site_weights = {};
  smooth->group.dilations = smooth->dilations;
  smooth->group.linear = smooth->linear;
  smooth->group.radial = smooth->radial;
  for (std::size_t l = 0; l < d; ++l) smooth->group.parameters[l].centre = kriging.centres[l];
  return smooth;
}

bool SetSmoothWeights(const SmoothGroup& smooth, std::span<const double> parameters,
                      CorrectionScratch& scratch, Movement& movement) {
  const Correction solved = CorrectWeights(smooth.group, ValuesOf(parameters),
                                           {.max_iterations = kSolveIterations}, scratch, movement);
  return solved.error_m <= kMaxMissM;
}

std::vector<double> MovementProducts(const MotionGroup& group, const GridLayout& layout,
                                     const Skeleton& skeleton) {
  const auto n = static_cast<std::size_t>(group.example_count);
  const auto joints = static_cast<std::size_t>(skeleton.joint_count());
  std::vector<std::vector<Vec3>> positions(n);
  std::vector<Quat> rotations(joints);
  std::vector<double> one_hot(n);
  for (std::size_t e = 0; e < n; ++e) {
    std::fill(one_hot.begin(), one_hot.end(), 0.0);
    one_hot[e] = 1.0;
    for (const Pose& pose : PosesAtGridPoints(group, layout, one_hot)) {
      positions[e].resize(positions[e].size() + joints);
      ForwardKinematics(skeleton, pose, std::span(positions[e]).last(joints), rotations);
    }
  }
  std::vector<double> products(n * n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k <= i; ++k) {
      double sum = 0.0;
      for (std::size_t at = 0; at < positions[i].size(); ++at) {
        sum += static_cast<double>(glm::dot(positions[i][at], positions[k][at]));
      }
      products[i * n + k] = products[k * n + i] = sum / static_cast<double>(positions[i].size());
    }
  }
  return products;
}

std::optional<Smoothness> ChooseSmoothness(const MotionGroup& group, std::span<const int> examples,
                                           std::span<const double> products) {
  const std::size_t d = group.parameters.size();
  const std::size_t m = examples.size();
  const auto n = static_cast<std::size_t>(group.example_count);
  if (m < static_cast<std::size_t>(kExamplesPerCoefficient) * (d + 1)) return std::nullopt;
  STRIDEWIRE_CHECK(products.size() == n * n);
  const std::vector<double> scales = ScalesOf(group);
  const std::vector<double> metric = MetricOf(group);
  const std::vector<double> sites = SitesOf(group, examples);
  std::vector<double> applied(sites.size());  // [example][d]
  std::vector<double> rest(sites.size() - d);
  for (std::size_t i = 0; i < m; ++i) {
    const auto begin = static_cast<std::ptrdiff_t>(i * d);
    std::copy(sites.begin(), sites.begin() + begin, rest.begin());
    std::copy(sites.begin() + begin + static_cast<std::ptrdiff_t>(d), sites.end(),
              rest.begin() + begin);
    ProjectOntoHull(rest, metric, kHullGrowth, std::span(sites).subspan(i * d, d),
                    std::span(applied).subspan(i * d, d));
  }
  Eigen::MatrixXd of_used(m, m);
  for (std::size_t i = 0; i < m; ++i) {
    for (std::size_t k = 0; k < m; ++k) {
      of_used(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
          products[static_cast<std::size_t>(examples[i]) * n +
                   static_cast<std::size_t>(examples[k])];
    }
  }
  std::optional<Smoothness> best;
  double least_m = HUGE_VAL;
  for (const double radius : kRadii) {
    for (const double ridge : kRidges) {
      const Smoothness smoothness{ridge, radius};
      const Kriging kriging(sites, scales, smoothness);
      if (!kriging.is_valid) continue;
      double sum_m = 0.0;
      for (std::size_t i = 0; i < m; ++i) {
        const auto left_out = static_cast<Eigen::Index>(i);
        Eigen::VectorXd difference =
            kriging.WeightsWithout(left_out, std::span<const double>(applied).subspan(i * d, d));
        difference(left_out) = -1.0;
        sum_m += std::sqrt(std::max(0.0, difference.dot(of_used * difference)));
      }
      if (sum_m < least_m) {
        least_m = sum_m;
        best = smoothness;
      }
    }
  }
  return best;
}

std::optional<Smoothness> SmoothExamples(const MotionGroup& group, const GridLayout& layout,
                                         const Skeleton& skeleton,
                                         std::vector<GridExample>& examples) {
  std::vector<int> all(static_cast<std::size_t>(group.example_count));
  std::iota(all.begin(), all.end(), 0);
  const auto smoothness = ChooseSmoothness(group, all, MovementProducts(group, layout, skeleton));
  const auto smooth = smoothness ? FitSmooth(group, all, *smoothness) : nullptr;
  if (smooth == nullptr) return std::nullopt;
  CorrectionScratch scratch(skeleton, layout, group.example_count);
  GridCache cache(layout);
  Pose pose(skeleton.joint_count());
  Movement movement;
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  for (GridExample& example : examples) {
    STRIDEWIRE_CHECK(example.parameters.size() == group.parameters.size());
    if (!SetSmoothWeights(*smooth, example.parameters, scratch, movement)) {
      continue;
    }
    cache.Clear();
    for (int point = 0; point < group.grid_point_count; ++point) {
      SetBlendedRow(cache.Row(smooth->group, movement.weights, point), layout,
                    &example.rows[static_cast<std::size_t>(point) * row_floats]);
    }
    BlendKeytimes(group.keytimes_s, movement.weights, example.keytimes_s);
    example.heading_change_rad = movement.heading_change_rad;
    const ParameterValues measured =
        MeasureMovement(skeleton, layout, smooth->group, movement, cache, pose);
    std::copy_n(measured.values.begin(), example.parameters.size(), example.parameters.begin());
  }
  return smoothness;
}

Expected<SmoothBasis> FitSmoothBasis(std::span<const double> sites,
                                     std::span<const double> scales) {
  const std::size_t d = scales.size();
  const std::size_t n = sites.size() / d;
  STRIDEWIRE_CHECK(n > 0 && sites.size() == n * d);
  CardinalBasisFit fit{.parameter_count = static_cast<int>(d),
                       .example_count = static_cast<int>(n),
                       .sites = sites,
                       .scales = scales};
  const auto fit_default_radii = [&]() -> Expected<SmoothBasis> {
    fit.radius_factors = {};
    Expected<CardinalBasis> basis = fit.Run();
    if (!basis) return std::unexpected(basis.error());
    return SmoothBasis{*std::move(basis), 1.0};
  };
  if (d < kWideFromParameters) return fit_default_radii();
  MotionGroup group;  // Only the members that SampleHull needs are set.
  group.parameters.resize(d);
  group.example_count = static_cast<int>(n);
  group.sites = sites;
  const std::vector<ParameterValues> samples = SampleHull(group, kWideSamples, kWideSeed);
  std::vector<double> weights(n);
  for (const double factor : kWideRadii) {
    const std::vector<double> factors(n, factor);
    fit.radius_factors = factors;
    Expected<CardinalBasis> basis = fit.Run();
    if (!basis || basis->condition >= kWideCondition) continue;
    const bool is_within_bounds = std::ranges::all_of(samples, [&](const ParameterValues& p) {
      EvaluateWeights({basis->centres, basis->scales, basis->sites, basis->dilations, basis->linear,
                       basis->radial},
                      std::span(p.values).first(d), weights);
      double sum = 0.0;
      for (const double weight : weights) sum += std::fabs(weight);
      return sum <= kWideWeightSum;
    });
    if (is_within_bounds) return SmoothBasis{*std::move(basis), factor};
  }
  return fit_default_radii();
}

}  // namespace stridewire
