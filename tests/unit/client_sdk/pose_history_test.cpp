#include "pose_history.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace stridewire::client {
namespace {

constexpr std::size_t kJoints = 2;
using Rotations = std::array<Quat, kJoints>;

Vec3 RootAt(double t) {
  return {static_cast<float>(std::sin(2.0 * t)), 1.0f, static_cast<float>(1.4 * t)};
}
Rotations RotationsAt(double t) { return {YawRotation(0.8 * t), YawRotation(std::sin(3.0 * t))}; }

/// Fills a history with one pose per `every_s`, starting at tick 1.
PoseHistory Moving(std::size_t capacity, int poses, double every_s = 1.0 / 60.0) {
  PoseHistory history(capacity, kJoints);
  for (int i = 0; i < poses; ++i) {
    const double t = i * every_s;
    history.Push({static_cast<std::uint64_t>(i + 1), t, false, false}, RootAt(t), RotationsAt(t));
  }
  return history;
}

TEST(PoseHistory, ReturnsReceivedPosesExactly) {
  const PoseHistory history = Moving(16, 10);
  for (std::size_t i = 0; i < history.size(); ++i) {
    Vec3 root_m;
    Rotations rotations;
    const auto sampled = history.Sample(history.stamp(i).time_s, root_m, rotations);
    ASSERT_TRUE(sampled);
    EXPECT_TRUE(sampled->interpolated);
    EXPECT_EQ(sampled->index, i);
    EXPECT_EQ(root_m, history.root_position_m(i));
    EXPECT_EQ(rotations[0], history.rotations(i)[0]);
    EXPECT_EQ(rotations[1], history.rotations(i)[1]);
  }
}

TEST(PoseHistory, InterpolatesCloseToTheMotion) {
  const PoseHistory history = Moving(64, 60);
  double worst_m = 0.0;
  double worst_rad = 0.0;
  for (double t = 0.1; t < 0.9; t += 0.0013) {
    Vec3 root_m;
    Rotations rotations;
    ASSERT_TRUE(history.Sample(t, root_m, rotations));
    worst_m = std::max(worst_m, static_cast<double>(glm::length(root_m - RootAt(t))));
    for (std::size_t j = 0; j < kJoints; ++j) {
      worst_rad = std::max(worst_rad, AngleBetween(rotations[j], RotationsAt(t)[j]));
    }
  }
  // The cubic error is of the order of h^4 f'''' / 384 plus float32 rounding. A linear
  // interpolation would have an error of h^2 f'' / 8, which is 1.4e-4 m and 3e-4 rad.
  EXPECT_LT(worst_m, 5e-6);
  EXPECT_LT(worst_rad, 1e-3 / 10.0);
}

TEST(PoseHistory, HasContinuousVelocity) {
  const PoseHistory history = Moving(64, 20, 0.1);
  const double e = 1e-3;
  for (std::size_t i = 2; i + 2 < history.size(); ++i) {
    const double t = history.stamp(i).time_s;
    Vec3 before_m;
    Vec3 at_m;
    Vec3 after_m;
    Rotations rotations;
    ASSERT_TRUE(history.Sample(t - e, before_m, rotations));
    ASSERT_TRUE(history.Sample(t, at_m, rotations));
    ASSERT_TRUE(history.Sample(t + e, after_m, rotations));
    // The one-sided speeds differ by at most acceleration * e.
    EXPECT_LT(glm::length((after_m - at_m) - (at_m - before_m)) / e, 0.1f) << i;
  }
}

TEST(PoseHistory, InterpolatesAlongTheShorterArc) {
  // q and -q are the same rotation.
  PoseHistory history(8, kJoints);
  for (int i = 0; i < 4; ++i) {
    Rotations r = RotationsAt(i * 0.1);
    if (i % 2 == 1) r = {-r[0], -r[1]};
    history.Push({static_cast<std::uint64_t>(i + 1), i * 0.1, false, false}, RootAt(i * 0.1), r);
  }
  for (double t = 0.0; t < 0.3; t += 0.01) {
    Vec3 root_m;
    Rotations rotations;
    ASSERT_TRUE(history.Sample(t, root_m, rotations));
    EXPECT_LT(AngleBetween(rotations[0], RotationsAt(t)[0]), 0.01) << t;
  }
}

TEST(PoseHistory, NeverInterpolatesAcrossADiscontinuity) {
  PoseHistory history(16, kJoints);
  const Rotations still{kIdentityQuat, kIdentityQuat};
  const Rotations turned{YawRotation(3.0), YawRotation(-2.0)};
  const Vec3 here_m(0.0f);
  const Vec3 there_m(100.0f, 0.0f, 0.0f);
  for (std::uint64_t tick = 1; tick <= 4; ++tick) {
    history.Push({tick, 0.1 * static_cast<double>(tick), false, false}, here_m, still);
  }
  for (std::uint64_t tick = 5; tick <= 8; ++tick) {
    history.Push({tick, 0.1 * static_cast<double>(tick), tick == 5, false}, there_m, turned);
  }
  for (double t = 0.1; t <= 0.8; t += 0.001) {
    Vec3 root_m;
    Rotations rotations;
    const auto sampled = history.Sample(t, root_m, rotations);
    ASSERT_TRUE(sampled);
    // There is no interpolation, and slopes use poses of one side only.
    const bool first = t < history.stamp(4).time_s;
    ASSERT_EQ(root_m, first ? here_m : there_m) << t;
    ASSERT_LT(AngleBetween(rotations[0], first ? still[0] : turned[0]), 1e-3) << t;
    if (t > 0.401 && t < 0.499) {
      EXPECT_FALSE(sampled->interpolated) << t;
    }
    if (t > 0.501 && t < 0.799) {
      EXPECT_TRUE(sampled->interpolated) << t;
    }
  }
}

TEST(PoseHistory, HoldsTheNewestPoseAndIsEmptyBeforeTheOldest) {
  const PoseHistory history = Moving(16, 10);
  Vec3 root_m;
  Rotations rotations;
  EXPECT_FALSE(history.Sample(-0.001, root_m, rotations));
  const auto late = history.Sample(100.0, root_m, rotations);
  ASSERT_TRUE(late);
  EXPECT_FALSE(late->interpolated);
  EXPECT_EQ(late->index, 9u);
  EXPECT_EQ(root_m, history.root_position_m(9));
  EXPECT_FALSE(PoseHistory(4, kJoints).Sample(0.0, root_m, rotations));
}

TEST(PoseHistory, DropsTheOldestPoseWhenFull) {
  const PoseHistory history = Moving(8, 100);
  ASSERT_EQ(history.size(), 8u);
  EXPECT_EQ(history.stamp(0).tick, 93u);
  EXPECT_EQ(history.stamp(7).tick, 100u);
  EXPECT_EQ(history.root_position_m(7), RootAt(99.0 / 60.0));
  EXPECT_EQ(history.FirstAfterTick(0), 0u);
  EXPECT_EQ(history.FirstAfterTick(95), 3u);
  EXPECT_EQ(history.FirstAfterTick(100), std::nullopt);
}

TEST(PoseHistory, RejectsPosesThatAreNotNewer) {
  PoseHistory history = Moving(8, 4);
  const auto newest = history.stamp(3);
  EXPECT_FALSE(history.Push(newest, Vec3(9.0f), RotationsAt(0.0)));
  EXPECT_FALSE(history.Push({2, 50.0, false, false}, Vec3(9.0f), RotationsAt(0.0)));
  EXPECT_FALSE(history.Push({99, 0.0, false, false}, Vec3(9.0f), RotationsAt(0.0)));
  EXPECT_EQ(history.size(), 4u);
}

TEST(PoseHistory, SamplesAreFiniteUnitQuaternions) {
  const std::uint64_t seed = 20;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::normal_distribution<float> normal;
  std::uniform_int_distribution<std::uint64_t> gap(1, 40);
  PoseHistory history(32, kJoints);
  std::uint64_t tick = 0;
  for (int i = 0; i < 2000; ++i) {
    tick += gap(random);
    Rotations r;
    for (Quat& q : r) {
      q = Normalise(Quat(normal(random), normal(random), normal(random), normal(random)));
    }
    history.Push({tick, static_cast<double>(tick) / 60.0, random() % 8 == 0, false},
                 Vec3(normal(random)), r);
    const double oldest_s = history.stamp(0).time_s;
    const double newest_s = history.stamp(history.size() - 1).time_s;
    std::uniform_real_distribution<double> when(oldest_s, newest_s + 0.1);
    Vec3 root_m;
    Rotations out;
    ASSERT_TRUE(history.Sample(when(random), root_m, out));
    ASSERT_TRUE(std::isfinite(root_m.x));
    for (const Quat& q : out) ASSERT_NEAR(Dot(q, q), 1.0f, 1e-5f);
  }
}

}  // namespace
}  // namespace stridewire::client
