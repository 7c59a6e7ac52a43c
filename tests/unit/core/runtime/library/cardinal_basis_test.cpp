#include "runtime/library/cardinal_basis.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

namespace stridewire {
namespace {

ConstBasisSpan View(const CardinalBasis& basis) {
  return {basis.centres, basis.scales, basis.sites, basis.dilations, basis.linear, basis.radial};
}

double Sum(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

TEST(CubicBSpline, HasContinuousSecondDerivative) {
  const double h = 1e-4;
  for (const double knot : {1.0, 2.0}) {
    EXPECT_NEAR(CubicBSpline(knot - 1e-12), CubicBSpline(knot + 1e-12), 1e-10);
    const auto second = [&](double u) {
      return (CubicBSpline(u - h) - 2.0 * CubicBSpline(u) + CubicBSpline(u + h)) / (h * h);
    };
    EXPECT_NEAR(second(knot - 2 * h), second(knot + 2 * h), 20 * h);
  }
  EXPECT_DOUBLE_EQ(CubicBSpline(0.0), 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(CubicBSpline(1.0), 1.0 / 6.0);
  EXPECT_EQ(CubicBSpline(2.0), 0.0);
  EXPECT_EQ(CubicBSpline(7.0), 0.0);
}

// Random sites in 1 to 7 dimensions.
class RandomSites : public testing::TestWithParam<int> {};

TEST_P(RandomSites, WeightsSumToOneAndReproduceTheExamples) {
  const auto d = static_cast<std::size_t>(GetParam());
  const unsigned seed = 7000 + static_cast<unsigned>(GetParam());
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> coordinate(-1.0, 1.0);
  for (const std::size_t n : {std::size_t{1}, d, d + 2, std::size_t{15}, std::size_t{60}}) {
    std::vector<double> sites(n * d);
    std::vector<double> scales(d, 1.0);
    for (double& value : sites) value = 5.0 + 0.4 * coordinate(random);
    const auto fit =
        CardinalBasisFit{static_cast<int>(d), static_cast<int>(n), sites, {}, scales}.Run();
    if (!fit) {  // In one dimension, two of 60 random sites may be too close.
      ASSERT_EQ(fit.error().code, ErrorCode::kIllConditioned);
      ASSERT_EQ(d, 1u);
      continue;
    }
    std::vector<double> weights(n);
    for (std::size_t e = 0; e < n; ++e) {
      EvaluateWeights(View(*fit), std::span(sites).subspan(e * d, d), weights);
      for (std::size_t k = 0; k < n; ++k) {
        ASSERT_NEAR(weights[k], k == e ? 1.0 : 0.0, 1e-9) << "seed " << seed << " n " << n;
      }
    }
    for (int sample = 0; sample < 300; ++sample) {
      std::vector<double> p(d);
      // Also far outside the sites.
      for (double& value : p) value = 5.0 + 0.8 * coordinate(random);
      EvaluateWeights(View(*fit), p, weights);
      ASSERT_NEAR(Sum(weights), 1.0, 1e-9) << "seed " << seed << " n " << n;
      if (n < d + 2) continue;
      for (std::size_t l = 0; l < d; ++l) {
        double reproduced = 0.0;
        for (std::size_t e = 0; e < n; ++e) reproduced += weights[e] * sites[e * d + l];
        ASSERT_NEAR(reproduced, p[l], 1e-8) << "seed " << seed << " n " << n;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, RandomSites, testing::Range(1, 8));

TEST(CardinalBasis, WeightsSumToOneUnderRankDeficiency) {
  // All sites are on a line far from the origin. Without centred parameters, the sum of the weights
  // would be off by 0.2.
  std::vector<double> sites;
  for (int i = 0; i < 6; ++i) sites.insert(sites.end(), {3.0 + 0.1 * i, 7.0 - 0.2 * i});
  const auto fit = CardinalBasisFit{2, 6, sites, {}, std::vector<double>{1.0, 1.0}}.Run();
  ASSERT_TRUE(fit.has_value());
  std::vector<double> weights(6);
  for (const auto& p : {std::array{3.2, 6.9}, std::array{4.0, 4.0}, std::array{0.0, 0.0}}) {
    EvaluateWeights(View(*fit), p, weights);
    EXPECT_NEAR(Sum(weights), 1.0, 1e-12);
  }
}

TEST(CardinalBasis, UsesAllExamplesBetweenSites) {
  // The paper says that most weights are zero. With the linear part they are not.
  std::vector<double> sites;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      if (i + j > 0) sites.insert(sites.end(), {0.25 * i, 0.25 * j});
    }
  }
  const auto fit = CardinalBasisFit{2, 15, sites, {}, std::vector<double>{1.0, 1.0}}.Run();
  ASSERT_TRUE(fit.has_value());
  EXPECT_LT(fit->condition, 10.0);
  std::vector<double> weights(15);
  int zero = 0;
  double largest_sum = 0.0;
  for (double a = 0.05; a < 0.75; a += 0.07) {
    for (double b = 0.25 - a > 0.05 ? 0.25 - a : 0.05; b < 0.75; b += 0.07) {
      EvaluateWeights(View(*fit), std::array{a, b}, weights);
      double sum = 0.0;
      for (const double w : weights) {
        zero += w == 0.0 ? 1 : 0;
        sum += std::fabs(w);
      }
      largest_sum = std::max(largest_sum, sum);
    }
  }
  EXPECT_EQ(zero, 0);
  EXPECT_GT(largest_sum, 1.1);
  EXPECT_LT(largest_sum, 2.5);
}

TEST(CardinalBasis, ReproducesTheWeightsOfPseudoexamples) {
  const std::vector<double> sites = {0.0, 1.0, 2.0, 0.6};
  const std::vector<double> pseudo = {0.5, 0.3, 0.2};
  const auto fit = CardinalBasisFit{1, 3, sites, pseudo, std::vector<double>{1.0}}.Run();
  ASSERT_TRUE(fit.has_value());
  std::vector<double> weights(3);
  EvaluateWeights(View(*fit), std::array{0.6}, weights);
  for (std::size_t e = 0; e < 3; ++e) EXPECT_NEAR(weights[e], pseudo[e], 1e-12);
  for (double p = -1.0; p < 3.0; p += 0.13) {
    EvaluateWeights(View(*fit), std::array{p}, weights);
    EXPECT_NEAR(Sum(weights), 1.0, 1e-12);
  }
}

TEST(CardinalBasis, RejectsInvalidInput) {
  const std::vector<double> scale = {1.0};
  const auto code = [&](std::vector<double> sites, int n, std::vector<double> scales) {
    const auto fit = CardinalBasisFit{1, n, sites, {}, scales}.Run();
    return fit ? "none" : std::string(ErrorCodeName(fit.error().code));
  };
  EXPECT_EQ(code({0.0, 1.0, 1.0 + 1e-6}, 3, scale), "ill_conditioned");
  EXPECT_EQ(code({0.0, NAN}, 2, scale), "out_of_range");
  EXPECT_EQ(code({0.0, 1.0}, 3, scale), "shape_mismatch");
  EXPECT_EQ(code({0.0, 1.0}, 2, {0.0}), "out_of_range");
  EXPECT_EQ(code({}, 0, scale), "shape_mismatch");
}

}  // namespace
}  // namespace stridewire
