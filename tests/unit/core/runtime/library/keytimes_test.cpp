#include "runtime/library/keytimes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace stridewire {
namespace {

const std::vector<double> kKeytimes = {0.0, 0.1, 0.45, 0.5};

TEST(Keytimes, GenericTimeMatchesEquation3) {
  EXPECT_DOUBLE_EQ(GenericTime(kKeytimes, 0.0), 0.0);
  EXPECT_DOUBLE_EQ(GenericTime(kKeytimes, 0.05), 0.5);
  EXPECT_DOUBLE_EQ(GenericTime(kKeytimes, 0.1), 1.0);
  EXPECT_DOUBLE_EQ(GenericTime(kKeytimes, 0.275), 1.5);
  EXPECT_DOUBLE_EQ(GenericTime(kKeytimes, 0.5), 3.0) << "t = K_n, which Eq. (3) leaves out";
}

TEST(Keytimes, ClampsTimesOutside) {
  EXPECT_DOUBLE_EQ(GenericTime(kKeytimes, -1.0), 0.0);
  EXPECT_DOUBLE_EQ(GenericTime(kKeytimes, 9.0), 3.0);
  EXPECT_DOUBLE_EQ(TimeAtGenericTime(kKeytimes, -1.0), 0.0);
  EXPECT_DOUBLE_EQ(TimeAtGenericTime(kKeytimes, 9.0), 0.5);
}

TEST(Keytimes, UsesTheLastOfSeveralEmptyIntervals) {
  const std::vector<double> keytimes = {0.0, 0.2, 0.2, 0.4};
  EXPECT_DOUBLE_EQ(GenericTime(keytimes, 0.2), 2.0);
}

TEST(Keytimes, TimeAtGenericTimeIsTheInverse) {
  for (double t = 0.0; t <= 0.5; t += 0.001) {
    EXPECT_NEAR(TimeAtGenericTime(kKeytimes, GenericTime(kKeytimes, t)), t, 1e-12);
  }
}

TEST(Keytimes, RejectsInvalidKeytimes) {
  EXPECT_TRUE(ValidateKeytimes(kKeytimes).has_value());
  EXPECT_FALSE(ValidateKeytimes(std::vector<double>{0.0}).has_value());
  EXPECT_FALSE(ValidateKeytimes(std::vector<double>(kMaxIntervals + 2, 0.0)).has_value());
  EXPECT_FALSE(ValidateKeytimes(std::vector<double>{0.1, 0.2}).has_value());
  const Status short_interval = ValidateKeytimes(std::vector<double>{0.0, 0.5, 0.5005});
  ASSERT_FALSE(short_interval.has_value());
  EXPECT_EQ(short_interval.error().index, 1);
  EXPECT_FALSE(ValidateKeytimes(std::vector<double>{0.0, NAN}).has_value());
}

TEST(BlendKeytimes, ReproducesTheKeytimesOfAnExample) {
  const std::vector<double> examples = {0.0, 0.1, 0.5, 0.6, 0.0, 0.2, 0.7, 1.0};
  std::vector<double> out(4);
  BlendKeytimes(examples, std::vector<float>{0.0f, 1.0f}, out);
  EXPECT_EQ(out, (std::vector<double>{0.0, 0.2, 0.7, 1.0}));
}

TEST(BlendKeytimes, StaysIncreasingUnderNegativeWeights) {
  // Random keytimes and weights far outside the hull. Their weighted sum alone, as in the paper,
  // would often decrease from one keytime to the next.
  const unsigned seed = 20261;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> length(0.03, 0.6);
  std::uniform_real_distribution<float> weight(-3.0f, 3.0f);
  int clamped = 0;
  for (int round = 0; round < 2000; ++round) {
    std::vector<double> examples;
    std::vector<float> weights;
    float sum = 0.0f;
    for (int e = 0; e < 6; ++e) {
      double t = 0.0;
      for (int i = 0; i < 4; ++i) {
        examples.push_back(t);
        t += length(random);
      }
      weights.push_back(e < 5 ? weight(random) : 1.0f - sum);
      sum += weights.back();
    }
    double plain = 0.0;
    for (std::size_t e = 0; e < 6; ++e) {
      plain += static_cast<double>(weights[e]) * (examples[e * 4 + 1] - examples[e * 4]);
    }
    clamped += plain <= 0.0 ? 1 : 0;
    std::vector<double> out(4);
    BlendKeytimes(examples, weights, out);
    for (std::size_t i = 0; i < 3; ++i) {
      ASSERT_GE(out[i + 1] - out[i], 0.5 * 0.03) << "seed " << seed << " round " << round;
    }
  }
  EXPECT_GT(clamped, 100) << "the test met no empty interval, so it proves nothing";
}

class TimeWarpTest : public testing::Test {
 protected:
  const std::vector<int> cells_ = {3, 10, 2};
  const TimeWarp warp_{kKeytimes, cells_};
};

TEST_F(TimeWarpTest, MapsKeytimesToGridPoints) {
  EXPECT_DOUBLE_EQ(warp_.GridPosition(0.0), 0.0);
  EXPECT_DOUBLE_EQ(warp_.GridPosition(0.1), 3.0);
  EXPECT_DOUBLE_EQ(warp_.GridPosition(0.45), 13.0);
  EXPECT_DOUBLE_EQ(warp_.GridPosition(0.5), 15.0);
  EXPECT_DOUBLE_EQ(warp_.GenericTimeAt(0.45), 2.0);
}

TEST_F(TimeWarpTest, IsMonotoneAndContinuousInVelocity) {
  const double h = 1e-6;
  double last = 0.0;
  double last_rate = NAN;
  for (double t = h; t < 0.5 - 2 * h; t += h * 50) {
    const double u = warp_.GridPosition(t);
    ASSERT_GE(u, last);
    const double rate = (warp_.GridPosition(t + h) - warp_.GridPosition(t)) / h;
    // The piecewise linear map would jump from 30 to 28.6 to 40 cells per second within one step
    // here.
    if (!std::isnan(last_rate)) {
      ASSERT_NEAR(rate, last_rate, 0.1) << t;
    }
    last = u;
    last_rate = rate;
  }
}

TEST_F(TimeWarpTest, TimeAtIsTheInverse) {
  for (double u = 0.0; u <= 15.0; u += 0.01) {
    ASSERT_NEAR(warp_.GridPosition(warp_.TimeAt(u)), u, 1e-9);
  }
}

TEST(TimeWarp, StaysCloseToTheLinearMap) {
  // Keytimes of a step whose intervals differ in rate by a factor of 4, as when blending steps of
  // 0.51 s and 0.90 s.
  const std::vector<double> keytimes = {0.0, 0.12, 0.55, 0.62};
  const std::vector<int> cells = {2, 13, 2};
  const TimeWarp warp(keytimes, cells);
  for (double t = 0.0; t <= 0.62; t += 0.001) {
    EXPECT_NEAR(TimeAtGenericTime(keytimes, warp.GenericTimeAt(t)), t, 0.025);
  }
}

}  // namespace
}  // namespace stridewire
