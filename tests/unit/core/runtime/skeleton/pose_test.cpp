#include "stridewire/runtime/pose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "runtime/movement/movement.h"

namespace stridewire {
namespace {

constexpr unsigned kSeed = 411;

Pose RandomPose(std::mt19937& random) {
  std::normal_distribution<float> normal;
  Pose pose(5);
  pose.root_position_m = {normal(random), normal(random), normal(random)};
  for (Quat& q : pose.rotations) {
    q = Normalise(Quat(normal(random), normal(random), normal(random), normal(random)));
  }
  return pose;
}

TEST(PoseArithmetic, AddUndoesSubtract) {
  std::mt19937 random(kSeed);
  for (int i = 0; i < 100; ++i) {
    const Pose a = RandomPose(random);
    const Pose b = RandomPose(random);
    Pose difference(5);
    Subtract(a, b, difference);
    Pose sum(5);
    Add(difference, b, sum);
    EXPECT_LT(glm::length(sum.root_position_m - a.root_position_m), 1e-5f);
    EXPECT_LT(LargestJointAngle(sum, a), 1e-3) << "seed " << kSeed;
  }
}

TEST(PoseArithmetic, SumsDoNotCommute) {
  // Sums do not commute: with r_A r_B instead of r_B r_A the result is up to 133 degrees off.
  std::mt19937 random(kSeed);
  const Pose a = RandomPose(random);
  const Pose b = RandomPose(random);
  Pose difference(5);
  Subtract(a, b, difference);
  Pose reversed(5);
  Add(b, difference, reversed);
  EXPECT_GT(LargestJointAngle(reversed, a), 0.2);
}

TEST(PoseArithmetic, ScalingTakesTheShortArc) {
  // A difference of 6.2 degrees that is stored with w < 0 must not be interpolated along the long
  // arc, where it would be 177 degrees half-way.
  const double half = 0.5 * 6.2 * M_PI / 180.0;
  Pose difference(1);
  difference.rotations[0] =
      -Quat(static_cast<float>(std::cos(half)), static_cast<float>(std::sin(half)), 0.0f, 0.0f);
  Pose scaled(1);
  Scale(0.5f, difference, scaled);
  EXPECT_NEAR(AngleBetween(scaled.rotations[0], kIdentityQuat), half, 1e-6);
}

TEST(PoseArithmetic, ScalesByZeroAndOneExactly) {
  std::mt19937 random(kSeed);
  const Pose a = RandomPose(random);
  Pose out(5);
  Scale(0.0f, a, out);
  EXPECT_LT(LargestJointAngle(out, Pose(5)), 1e-6);
  Scale(1.0f, a, out);
  EXPECT_LT(LargestJointAngle(out, a), 1e-3);
}

TEST(EaseOut, FallsFromOneToZeroWithZeroSlopeAtBothEnds) {
  EXPECT_EQ(EaseOut(0.0), 1.0);
  EXPECT_EQ(EaseOut(1.0), 0.0);
  EXPECT_EQ(EaseOut(5.0), 0.0);
  EXPECT_DOUBLE_EQ(EaseOut(0.5), 0.5);
  EXPECT_NEAR((EaseOut(1e-4) - 1.0) / 1e-4, 0.0, 1e-3);
  EXPECT_NEAR(EaseOut(1.0 - 1e-4) / 1e-4, 0.0, 1e-3);
}

TEST(Heading, MatchesAKnownQuaternion) {
  for (double heading = -3.0; heading < 3.1; heading += 0.1) {
    double found = 99.0;
    ASSERT_TRUE(HeadingOf(YawRotation(heading), found));
    EXPECT_NEAR(found, heading, 1e-6);
    const DVec3 forward = RotateYaw(heading, {0.0, 0.0, 1.0});
    EXPECT_NEAR(forward.x, std::sin(heading), 1e-12);
    EXPECT_NEAR(forward.z, std::cos(heading), 1e-12);
    const Vec3 rotated = YawRotation(heading) * Vec3(0.0f, 0.0f, 1.0f);
    EXPECT_NEAR(rotated.x, forward.x, 1e-6);
  }
}

TEST(Heading, IsUnchangedIfTheRootPointsUp) {
  double heading = 0.7;
  const float s = std::sqrt(0.5f);
  EXPECT_FALSE(HeadingOf(Quat(s, -s, 0.0f, 0.0f), heading));
  EXPECT_EQ(heading, 0.7);
}

TEST(ForwardKinematics, ComputesPositionsAndRotations) {
  Skeleton skeleton;
  skeleton.joints = {{"root", -1, {}}, {"a", 0, {0, 1, 0}}, {"b", 1, {0, 1, 0}}};
  skeleton.legs[0] = skeleton.legs[1] = {0, 1, 2, 2, {0, 0.5f, 0}, {0, 1, 0}};
  Pose pose(3);
  pose.root_position_m = {1, 2, 3};
  const float s = std::sqrt(0.5f);
  pose.rotations[1] = Quat(s, 0.0f, 0.0f, s);  // 90 degrees about z turns y into -x.
  std::vector<Vec3> positions(3);
  std::vector<Quat> rotations(3);
  ForwardKinematics(skeleton, pose, positions, rotations);
  EXPECT_LT(glm::length(positions[1] - Vec3(1, 3, 3)), 1e-6f);
  EXPECT_LT(glm::length(positions[2] - Vec3(0, 3, 3)), 1e-6f);
  EXPECT_LT(glm::length(BallPosition(skeleton, pose, Foot::kLeft) - Vec3(-0.5f, 3, 3)), 1e-6f);
}

}  // namespace
}  // namespace stridewire
