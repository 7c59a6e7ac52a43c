#include "pose_history.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

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

// The same formula as the SIMD kernel, for one rotation.
Quat InterpolateOne(const std::array<Quat, 4>& keys, bool is_before, float value, float start_slope,
                    float end_slope) {
  const auto near = [](const Quat& q, const Quat& reference) {
    return Dot(q, reference) < 0.0f ? -q : q;
  };
  const Quat start = keys[1];
  const Quat before = near(keys[0], start);
  const Quat end = near(keys[2], start);
  const Quat beyond = near(keys[3], end);
  const Quat slope_end = is_before ? start : end;
  return Normalise(start + (end - start) * value + (slope_end - before) * start_slope +
                   (beyond - start) * end_slope);
}

TEST(PoseHistory, InterpolatesAnyNumberOfRotationsWithTheSameBits) {
  constexpr unsigned kSeed = 7;
  SCOPED_TRACE(testing::Message() << "seed " << kSeed);
  std::mt19937 random(kSeed);
  std::normal_distribution<float> normal;
  const Vec3 origin_m(0.0f);
  for (std::size_t joints = 1; joints <= 35; ++joints) {
    std::array<std::vector<Quat>, 4> keys;
    for (auto& key : keys) {
      for (std::size_t j = 0; j < joints; ++j) {
        key.push_back(
            Normalise(Quat(normal(random), normal(random), normal(random), normal(random))));
      }
    }
    for (const bool is_before : {false, true}) {
      const float u = 0.3f;
      const float value = u * u * (3.0f - 2.0f * u);
      // Keys at 0, 1, 2 and 3 s: the slope at the start is a secant of 2 s, or of 1 s.
      const float start_slope = u * (1.0f - u) * (1.0f - u) * (is_before ? 1.0f : 0.5f);
      const float end_slope = u * u * (u - 1.0f) * 0.5f;
      const auto pose = [&](std::size_t k) { return ConstPoseSpan{origin_m, keys[k]}; };
      Vec3 root_m;
      std::vector<Quat> rotations(joints);
      InterpolatePose({.times_s = {0.0, 1.0, 2.0, 3.0},
                       .before = pose(0),
                       .start = pose(1),
                       .end = pose(2),
                       .beyond = pose(3),
                       .start_slope_is_before = is_before},
                      1.0 + static_cast<double>(u), root_m, rotations);
      for (std::size_t j = 0; j < joints; ++j) {
        const Quat expected = InterpolateOne({keys[0][j], keys[1][j], keys[2][j], keys[3][j]},
                                             is_before, value, start_slope, end_slope);
        EXPECT_EQ(rotations[j], expected) << joints << " joints, joint " << j;
      }
    }
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

TEST(PoseHistory, ExtrapolatesUntilItStops) {
  const PoseHistory history = Moving(16, 10);
  const double newest_s = history.stamp(9).time_s;
  const Vec3 newest_m = history.root_position_m(9);
  Vec3 last_m = newest_m;
  Rotations rotations;
  float last_step_m = 1.0f;
  for (int i = 1; i <= 26; ++i) {
    Vec3 root_m;
    const auto sampled = history.Sample(newest_s + 0.01 * i, root_m, rotations);
    ASSERT_TRUE(sampled);
    EXPECT_EQ(sampled->index, 9u);
    EXPECT_FALSE(sampled->interpolated);
    EXPECT_EQ(sampled->extrapolated, i < 25) << i;
    // The speed is at first that before the newest pose, and then decreases.
    const float step_m = glm::length(root_m - last_m);
    EXPECT_LT(step_m, last_step_m);
    if (i == 1) {
      const Vec3 before_m = newest_m - history.root_position_m(8);
      EXPECT_NEAR(step_m, 0.01f * 60.0f * glm::length(before_m), 0.002f);
    }
    last_step_m = step_m > 0.0f ? step_m : 1e-6f;
    last_m = root_m;
  }
  Vec3 root_m;
  ASSERT_TRUE(history.Sample(100.0, root_m, rotations));
  EXPECT_EQ(root_m, last_m);
}

TEST(PoseHistory, HoldsASinglePoseAndIsEmptyBeforeTheOldest) {
  const PoseHistory history = Moving(16, 1);
  Vec3 root_m;
  Rotations rotations;
  EXPECT_FALSE(history.Sample(-0.001, root_m, rotations));
  const auto late = history.Sample(100.0, root_m, rotations);
  ASSERT_TRUE(late);
  EXPECT_FALSE(late->interpolated || late->extrapolated);
  EXPECT_EQ(root_m, history.root_position_m(0));
  EXPECT_FALSE(PoseHistory(4, kJoints).Sample(0.0, root_m, rotations));
}

/// Displays at 1 kHz while pose i arrives `delay_s(i)` after its time, and returns the largest
/// change of the root's velocity between two frames, in m/s.
template <typename Delay>
float LargestVelocityChange(double display_delay_s, const Delay& delay_s, int& extrapolated) {
  constexpr double kEveryS = 1.0 / 30.0;
  PoseHistory history(16, kJoints);
  int next = 0;
  float largest_m_s = 0.0f;
  std::array<Vec3, 2> last_m{};
  int frames = 0;
  Rotations rotations;
  for (double now_s = 0.0; now_s < 3.0; now_s += 1e-3) {
    for (; next * kEveryS + delay_s(next) <= now_s; ++next) {
      const double t = next * kEveryS;
      history.Push({static_cast<std::uint64_t>(next + 1), t, false, 0, false}, RootAt(t),
                   RotationsAt(t));
    }
    Vec3 root_m;
    const auto sampled = history.Display(now_s - display_delay_s, root_m, rotations);
    if (!sampled) continue;
    extrapolated += sampled->extrapolated ? 1 : 0;
    if (++frames > 100) {
      const Vec3 change_m = root_m - 2.0f * last_m[1] + last_m[0];
      largest_m_s = std::max(largest_m_s, glm::length(change_m) / 1e-3f);
    }
    last_m = {last_m[1], root_m};
  }
  return largest_m_s;
}

TEST(PoseHistory, VelocityIsContinuousIfTheNextPoseIsMissing) {
  // Each interval is displayed before the pose after it has arrived.
  int extrapolated = 0;
  const float change_m_s =
      LargestVelocityChange(1.0 / 30.0 + 0.005, [](int) { return 0.0; }, extrapolated);
  EXPECT_EQ(extrapolated, 0);
  // The root accelerates by at most 4 m/s^2; a change of the curve would be a multiple of this.
  EXPECT_LT(change_m_s, 0.02f);
}

TEST(PoseHistory, LatePosesDoNotJump) {
  int extrapolated = 0;
  const float change_m_s = LargestVelocityChange(
      1.0 / 30.0 + 0.005, [](int i) { return i >= 40 && i < 45 ? 0.15 : 0.0; }, extrapolated);
  EXPECT_GT(extrapolated, 50);
  // A jump by 0.1 m between two frames would be a change of the velocity by 100 m/s.
  EXPECT_LT(change_m_s, 1.6f);
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
