#include "stridewire/runtime/clip.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace stridewire {
namespace {

Quat AxisAngle(const Vec3& axis, double angle_rad) {
  return glm::angleAxis(static_cast<float>(angle_rad), glm::normalize(axis));
}

// A smooth motion with a known value at every time: two joints rotate at varying speeds and the
// root follows a curve.
Vec3 RootAt(double t) {
  return Vec3(static_cast<float>(std::sin(2.0 * t)),
              static_cast<float>(0.9 + 0.05 * std::cos(5 * t)), static_cast<float>(1.2 * t));
}
Quat RotationAt(int joint, double t) {
  return joint == 0 ? AxisAngle(Vec3(0, 1, 0), 0.8 * std::sin(1.5 * t))
                    // Passes half a turn, so the signs of quaternions matter.
                    : AxisAngle(Vec3(1, 0.2f, 0), 4.0 * t);
}

double LargestAngle(const ConstPoseSpan& a, const ConstPoseSpan& b) {
  double largest = 0.0;
  for (std::size_t j = 0; j < a.rotations.size(); ++j) {
    largest = std::max(largest, AngleBetween(a.rotations[j], b.rotations[j]));
  }
  return largest;
}

Clip MakeClip(double fps, int frames) {
  Clip clip;
  clip.fps = fps;
  clip.Resize(frames, 2);
  for (int f = 0; f < frames; ++f) {
    clip.frame(f).root_position_m = RootAt(f / fps);
    for (int j = 0; j < 2; ++j)
      clip.frame(f).rotations[static_cast<std::size_t>(j)] = RotationAt(j, f / fps);
  }
  return clip;
}

TEST(Clip, ValidateReportsEveryError) {
  const Clip good = MakeClip(30.0, 10);
  EXPECT_TRUE(good.Validate().has_value());

  for (const double fps :
       {0.0, -30.0, 10000.5, std::nan(""), std::numeric_limits<double>::infinity()}) {
    Clip clip = good;
    clip.fps = fps;
    ASSERT_FALSE(clip.Validate().has_value()) << fps;
    EXPECT_EQ(clip.Validate().error().code, ErrorCode::kOutOfRange) << fps;
  }
  Clip no_frame = good;
  no_frame.Resize(0, 2);
  EXPECT_EQ(no_frame.Validate().error().code, ErrorCode::kOutOfRange);
  Clip no_joint = good;
  no_joint.joint_count = 0;
  EXPECT_EQ(no_joint.Validate().error().code, ErrorCode::kOutOfRange);
  Clip short_of_one = good;
  short_of_one.rotations.pop_back();
  EXPECT_EQ(short_of_one.Validate().error().code, ErrorCode::kShapeMismatch);

  Clip infinite = good;
  infinite.root_positions_m[7].y = std::numeric_limits<float>::infinity();
  EXPECT_EQ(infinite.Validate().error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(infinite.Validate().error().index, 7);
  Clip not_a_number = good;
  not_a_number.rotations[2 * 4 + 1].x = std::nanf("");
  EXPECT_EQ(not_a_number.Validate().error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(not_a_number.Validate().error().index, 4);
  Clip long_rotation = good;
  long_rotation.rotations[2 * 5] *= 1.002f;
  EXPECT_EQ(long_rotation.Validate().error().index, 5);
  long_rotation.rotations[2 * 5] = good.rotations[2 * 5] * 1.0005f;
  EXPECT_TRUE(long_rotation.Validate().has_value());
}

TEST(Clip, MakeSignContinuousKeepsRotations) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  const Clip original = MakeClip(60.0, 200);
  Clip clip = original;
  for (Quat& q : clip.rotations) {
    if (random() % 2 == 0) q = -q;
  }
  MakeSignContinuous(clip);
  for (int f = 1; f < clip.frame_count(); ++f) {
    for (std::size_t j = 0; j < 2; ++j) {
      ASSERT_GT(Dot(clip.frame(f - 1).rotations[j], clip.frame(f).rotations[j]), 0.0f);
    }
  }
  for (std::size_t i = 0; i < clip.rotations.size(); ++i) {
    ASSERT_EQ(std::fabs(Dot(clip.rotations[i], original.rotations[i])),
              Dot(original.rotations[i], original.rotations[i]));
  }
}

TEST(SampleClip, ReturnsSamplesUnchanged) {
  const Clip clip = MakeClip(120.0, 50);
  Pose pose(2);
  for (int f = 0; f < 50; ++f) {
    SampleClip(clip, f / 120.0, pose);
    EXPECT_NEAR(
        glm::length(pose.root_position_m - clip.root_positions_m[static_cast<std::size_t>(f)]), 0.0,
        1e-6);
    EXPECT_LT(LargestAngle(pose, clip.frame(f)), 1e-5);
  }
}

TEST(SampleClip, InterpolatesSmoothMotion) {
  const Clip clip = MakeClip(30.0, 60);
  Pose pose(2);
  double worst_m = 0.0;
  double worst_rad = 0.0;
  for (double t = 0.0; t < clip.duration_s(); t += 0.00137) {
    SampleClip(clip, t, pose);
    worst_m = std::max(worst_m, static_cast<double>(glm::length(pose.root_position_m - RootAt(t))));
    for (int j = 0; j < 2; ++j) {
      const Quat& q = pose.rotations[static_cast<std::size_t>(j)];
      ASSERT_NEAR(Dot(q, q), 1.0f, 1e-5f);
      worst_rad = std::max(worst_rad, AngleBetween(q, RotationAt(j, t)));
    }
  }
  // Linear interpolation would be off by a h^2 / 8, which is 0.7 mm at 5 m/s^2. The error of the
  // cubic is of order h^3, except in the first and last interval, where it is of order h^2.
  EXPECT_LT(worst_m, 0.6e-3);
  EXPECT_LT(worst_rad, 1e-3);
}

TEST(SampleClip, HasContinuousVelocityAtSamples) {
  Clip clip = MakeClip(30.0, 40);
  // Irregular data, for which linear interpolation would have clear kinks, with random signs.
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> noise(-0.05, 0.05);
  for (int f = 0; f < 40; ++f) {
    clip.frame(f).root_position_m.x += static_cast<float>(noise(random));
    clip.frame(f).rotations[1] = RotationAt(1, f / 30.0 + noise(random) / 4);
    if (random() % 2 == 0) clip.frame(f).rotations[1] = -clip.frame(f).rotations[1];
  }
  const double h = 1e-3;
  const auto step = [&](double t0, double t1, double& velocity_m_s, Vec3& spin_rad_s) {
    Pose a(2), b(2);
    SampleClip(clip, t0, a);
    SampleClip(clip, t1, b);
    velocity_m_s = (b.root_position_m.x - a.root_position_m.x) / (t1 - t0);
    Quat d = glm::conjugate(a.rotations[1]) * b.rotations[1];
    if (d.w < 0.0f) d = -d;
    spin_rad_s = Vec3(d.x, d.y, d.z) * static_cast<float>(2.0 / (t1 - t0));
  };
  double largest_kink = 0.0, largest_spin_kink = 0.0, linear_kink = 0.0;
  for (int f = 2; f < 38; ++f) {
    const double t = f / 30.0;
    double before = 0.0, after = 0.0;
    Vec3 spin_before, spin_after;
    step(t - h, t, before, spin_before);
    step(t, t + h, after, spin_after);
    largest_kink = std::max(largest_kink, std::fabs(after - before));
    largest_spin_kink =
        std::max(largest_spin_kink, static_cast<double>(glm::length(spin_after - spin_before)));
    const auto x = [&](int g) { return clip.root_positions_m[static_cast<std::size_t>(g)].x; };
    linear_kink = std::max(linear_kink, std::fabs(30.0 * (x(f + 1) - 2.0 * x(f) + x(f - 1))));
  }
  EXPECT_GT(linear_kink, 2.0);
  // The remaining step in velocity is the acceleration times h. Second differences of 0.2 m over
  // (1/30 s)^2 are some hundred m/s^2.
  EXPECT_LT(largest_kink, 0.35 * linear_kink);
  EXPECT_LT(largest_spin_kink, 1.0);
}

TEST(SampleClip, ClampsTimeAndAcceptsASingleFrame) {
  const Clip clip = MakeClip(30.0, 10);
  Pose pose(2);
  for (const double t : {-1.0, -std::numeric_limits<double>::infinity(), std::nan("")}) {
    SampleClip(clip, t, pose);
    EXPECT_EQ(pose.root_position_m, clip.root_positions_m.front());
  }
  for (const double t : {0.3, 5.0, 1e18, std::numeric_limits<double>::infinity()}) {
    SampleClip(clip, t, pose);
    EXPECT_EQ(pose.root_position_m, clip.root_positions_m.back());
    EXPECT_EQ(pose.rotations[1], clip.rotations.back());
  }
  Clip single = MakeClip(30.0, 1);
  SampleClip(single, 0.5, pose);
  EXPECT_EQ(pose.root_position_m, single.root_positions_m[0]);
}

}  // namespace
}  // namespace stridewire
