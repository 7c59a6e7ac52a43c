#include "offline/build/smooth_jolts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "synthetic_walker.h"

namespace stridewire {
namespace {

constexpr double kLimitRadPerS2 = 400.0;
constexpr std::size_t kPoints = 25;
constexpr double kDurationS = 0.8;

// Rotates a joint about its x axis.
Quat Bend(double angle_rad) {
  return {static_cast<float>(std::cos(0.5 * angle_rad)),
          static_cast<float>(std::sin(0.5 * angle_rad)), 0.0f, 0.0f};
}

// An example in which all joints rest.
class SmoothJolts : public testing::Test {
 protected:
  void SetUp() override {
    RecordProperty("seed", static_cast<int>(seed_));
    example_.keytimes_s = {0.0, 0.2, 0.6, kDurationS};
    example_.rows.assign(kPoints * static_cast<std::size_t>(layout_.row_floats), 0.0f);
    for (std::size_t p = 0; p < kPoints; ++p) {
      for (int j = 0; j < skeleton_.joint_count(); ++j) Set(j, p, kIdentityQuat);
    }
  }
  [[nodiscard]] Quat At(int joint, std::size_t point) const {
    return GridLayout::RotationOf(Row(point), static_cast<std::size_t>(joint));
  }
  void Set(int joint, std::size_t point, const Quat& rotation) {
    GridLayout::SetRotation(const_cast<float*>(Row(point)), static_cast<std::size_t>(joint),
                            rotation);
  }
  [[nodiscard]] const float* Row(std::size_t point) const {
    return &example_.rows[point * static_cast<std::size_t>(layout_.row_floats)];
  }
  // Returns the largest angular acceleration of a joint.
  [[nodiscard]] double LargestAcceleration(int joint) const {
    const double spacing_s = kDurationS / (kPoints - 1);
    double largest = 0.0;
    for (std::size_t p = 1; p + 1 < kPoints; ++p) {
      const Quat before = glm::conjugate(At(joint, p - 1)) * At(joint, p);
      const Quat after = glm::conjugate(At(joint, p)) * At(joint, p + 1);
      const Vec3 change =
          2.0f * (Vec3(after.x, after.y, after.z) - Vec3(before.x, before.y, before.z));
      largest = std::max(largest, static_cast<double>(glm::length(change)));
    }
    return largest / (spacing_s * spacing_s);
  }
  bool Smooth() { return stridewire::SmoothJolts(skeleton_, layout_, example_); }

  std::uint32_t seed_ = std::random_device{}();
  std::mt19937 random_{seed_};
  Skeleton skeleton_ = SyntheticWalker{}.Walk({{Foot::kLeft, 0.5}}).skeleton;
  GridLayout layout_{skeleton_.joint_count()};
  GridExample example_;
  int spine_ = skeleton_.FindJoint("Spine");
  int arm_ = skeleton_.FindJoint("LeftArm");
};

TEST_F(SmoothJolts, LeavesMovementsOfPeopleUnchanged) {
  // 60 degrees back and forth within 0.4 s.
  for (std::size_t p = 0; p < kPoints; ++p) {
    const double s = static_cast<double>(p) / (kPoints - 1);
    Set(arm_, p, Bend(0.5 * (1.0 - std::cos(4.0 * std::acos(-1.0) * s))));
  }
  const std::vector<float> before = example_.rows;
  EXPECT_FALSE(Smooth());
  EXPECT_EQ(example_.rows, before);
}

TEST_F(SmoothJolts, RemovesNoiseAndKeepsTheEnds) {
  SCOPED_TRACE(seed_);
  std::normal_distribution<double> noise(0.0, 0.25);
  for (std::size_t p = 0; p < kPoints; ++p) Set(spine_, p, Bend(noise(random_)));
  ASSERT_GT(LargestAcceleration(spine_), kLimitRadPerS2);
  const Quat first = At(spine_, 0);
  const Quat last = At(spine_, kPoints - 1);
  const double before = LargestAcceleration(spine_);
  EXPECT_TRUE(Smooth());
  EXPECT_LT(LargestAcceleration(spine_), before);
  EXPECT_LT(AngleBetween(At(spine_, 0), first), 1e-3);
  EXPECT_LT(AngleBetween(At(spine_, kPoints - 1), last), 1e-3);
}

TEST_F(SmoothJolts, SmoothsSingleJoltsBelowTheLimit) {
  Set(spine_, kPoints / 2, Bend(0.5));
  ASSERT_GT(LargestAcceleration(spine_), 2.0 * kLimitRadPerS2);
  EXPECT_TRUE(Smooth());
  EXPECT_LT(LargestAcceleration(spine_), 1.01 * kLimitRadPerS2);
  // Far from the jolt, nothing changes.
  for (const std::size_t p : {std::size_t{0}, std::size_t{3}, kPoints - 4, kPoints - 1}) {
    EXPECT_LT(AngleBetween(At(spine_, p), kIdentityQuat), 1e-3) << p;
  }
}

TEST_F(SmoothJolts, HardlyTurnsChildrenThatCompensateTheNoise) {
  const std::size_t middle = kPoints / 2;
  Set(spine_, middle, Bend(0.5));
  Set(arm_, middle, Bend(-0.5));
  EXPECT_TRUE(Smooth());
  EXPECT_LT(LargestAcceleration(spine_), 1.01 * kLimitRadPerS2);
  // The arm, which did not turn in the world before smoothing, turns by less than 0.1 rad.
  for (std::size_t p = 0; p < kPoints; ++p) {
    EXPECT_LT(AngleBetween(At(spine_, p) * At(arm_, p), kIdentityQuat), 0.1) << p;
  }
}

TEST_F(SmoothJolts, LeavesJointsThatCompensateTheirParentsUnchanged) {
  Set(0, kPoints / 2, Bend(0.3));
  Set(spine_, kPoints / 2, Bend(-0.3));
  const std::vector<float> before = example_.rows;
  EXPECT_FALSE(Smooth());
  EXPECT_EQ(example_.rows, before);
}

TEST_F(SmoothJolts, LeavesLegsUnchanged) {
  for (const int joint : {skeleton_.legs[0].hip, skeleton_.legs[0].knee, skeleton_.legs[1].ankle}) {
    Set(joint, kPoints / 2, Bend(0.5));
  }
  const std::vector<float> before = example_.rows;
  EXPECT_FALSE(Smooth());
  EXPECT_EQ(example_.rows, before);
}

}  // namespace
}  // namespace stridewire
