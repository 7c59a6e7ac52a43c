// Compares the inverse kinematics of a leg with its forward kinematics for random targets in reach.

#include "runtime/skeleton/leg_rig.h"

#include <gtest/gtest.h>

#include <random>

#include "test_library.h"

namespace stridewire {
namespace {

class SolveLegTest : public testing::Test {
 protected:
  double Draw(double low, double high) {
    return low + (high - low) * static_cast<double>(random_()) / 4294967296.0;
  }
  Quat DrawRotation(double most_rad) {
    const DVec3 axis(Draw(-1, 1), Draw(-1, 1), Draw(-1, 1));
    const DQuat q = glm::angleAxis(Draw(0, most_rad), glm::normalize(axis));
    return Quat(static_cast<float>(q.w), static_cast<float>(q.x), static_cast<float>(q.y),
                static_cast<float>(q.z));
  }

  static constexpr unsigned kSeed = 7;
  std::mt19937 random_{kSeed};
  const std::shared_ptr<const MotionLibrary> library_ = MakeTestLibrary();
  const Skeleton& skeleton_ = library_->skeleton();
  const LegRig& rig_ = library_->leg_rig();
};
using SolveLegs = SolveLegTest;

TEST_F(SolveLegs, MovesTheAnkleToTheTarget) {
  ASSERT_TRUE(rig_.is_usable);
  int reached = 0;
  for (int i = 0; i < 2000; ++i) {
    Pose pose = library_->stand_pose();
    for (Quat& rotation : pose.rotations) rotation = rotation * DrawRotation(0.6);
    const Foot foot = i % 2 == 0 ? Foot::kLeft : Foot::kRight;
    const LegRig::Side& side = rig_.side(foot);
    LegPose leg;
    EvaluateLeg(skeleton_, rig_, pose, foot, leg);
    const Vec3 hip = leg.positions_m[static_cast<std::size_t>(side.hip)];
    const double length_m = static_cast<double>(side.thigh_m) + side.shank_m;
    const DVec3 away = glm::normalize(DVec3(Draw(-0.6, 0.6), -1.0, Draw(-0.8, 0.8)));
    const double distance_m = Draw(0.2, 1.1) * length_m;
    const Vec3 target = hip + Vec3(distance_m * away);
    const Quat rotation = DrawRotation(3.0);
    SolveLeg(rig_, foot, leg, target, rotation, pose);

    LegPose solved;
    EvaluateLeg(skeleton_, rig_, pose, foot, solved);
    const auto ankle = static_cast<std::size_t>(side.ankle);
    const auto knee = static_cast<std::size_t>(side.knee);
    const Vec3 at = solved.positions_m[ankle];
    if (distance_m <= kMaxLegExtension * length_m) {
      EXPECT_LT(glm::length(at - target), 1e-5f) << "seed " << kSeed << " case " << i;
      ++reached;
    } else {
      EXPECT_NEAR(glm::length(at - hip), kMaxLegExtension * length_m, 1e-4);
      EXPECT_LT(glm::length(glm::cross(glm::normalize(at - hip), Vec3(away))), 1e-3f);
    }
    EXPECT_LT(AngleBetween(solved.world_rotations[ankle], rotation), 1e-3);
    // Bones must keep their lengths, and other joints their rotations.
    EXPECT_NEAR(glm::length(solved.positions_m[knee] - hip), side.thigh_m, 1e-5);
    EXPECT_NEAR(glm::length(at - solved.positions_m[knee]), side.shank_m, 1e-5);
    for (const Quat& local : pose.rotations) EXPECT_NEAR(Dot(local, local), 1.0f, 1e-5f);
  }
  EXPECT_GT(reached, 1000);
}

TEST_F(SolveLegs, KeepsALegThatIsAtItsTarget) {
  for (int i = 0; i < 500; ++i) {
    Pose pose = library_->stand_pose();
    const Foot foot = i % 2 == 0 ? Foot::kLeft : Foot::kRight;
    const LegRig::Side& side = rig_.side(foot);
    // A knee that is bent forward by 10 to 100 degrees; all other joints are random.
    pose.rotations[0] = DrawRotation(3.0);
    const auto joint = [&](int place) {
      return static_cast<std::size_t>(side.chain[static_cast<std::size_t>(place)]);
    };
    pose.rotations[joint(side.hip)] = DrawRotation(0.8);
    const auto bend = static_cast<float>(0.5 * Draw(0.18, 1.7));
    pose.rotations[joint(side.knee)] = Quat(std::cos(bend), std::sin(bend), 0.0f, 0.0f);
    LegPose leg;
    EvaluateLeg(skeleton_, rig_, pose, foot, leg);
    const Pose before = pose;
    const auto ankle = static_cast<std::size_t>(side.ankle);
    SolveLeg(rig_, foot, leg, leg.positions_m[ankle], leg.world_rotations[ankle], pose);
    EXPECT_LT(LargestJointAngle(before, pose), 2e-3) << "seed " << kSeed << " case " << i;
  }
}

}  // namespace
}  // namespace stridewire
