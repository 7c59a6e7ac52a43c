#include "offline/complete/generic_stride.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/trig.h"
#include "offline/base/degrees.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step.h"
#include "runtime/library/knee_hinges.h"

namespace stridewire::complete {
namespace {

// The generated figure, standing with bent knees and a bent trunk as in a fight.
struct Crouching {
  Skeleton skeleton = builtin::MakeFigure();
  Pose stand{builtin::kFigureJointCount};
  LegRig rig;

  explicit Crouching(double lowered_m, double lean_rad) {
    builtin::StorePose(builtin::StandingPose(), stand);
    const RawExample step = builtin::MakeStep(
        skeleton, Foot::kLeft, builtin::StraightShape(Foot::kLeft, 0.5, 0.5), {}, "");
    const std::array clips = {&step.clip};
    rig = MakeLegRig(skeleton, stand, LearnKneeHinges(skeleton, stand, clips));
    Pose crouch = stand;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const auto ankle = static_cast<std::size_t>(rig.side(foot).ankle);
      LegPose leg;
      EvaluateLeg(skeleton, rig, stand, foot, leg);
      SolveLeg(rig, foot, leg,
               leg.positions_m[ankle] + Vec3(0.0f, static_cast<float>(lowered_m), 0.0f),
               leg.world_rotations[ankle], crouch);
    }
    crouch.root_position_m.y -= static_cast<float>(lowered_m);
    Quat& trunk = crouch.rotations[builtin::kLowerBack];
    trunk = Quat(builtin::RotateX(lean_rad)) * trunk;
    stand = crouch;
  }

  [[nodiscard]] StrideModel Stride() const {
    return GenericStride(skeleton, rig, SampleOf(skeleton, stand, 0.0), Foot::kLeft);
  }
};

struct Posture {
  double knee_deg = 0.0;  // Bend of the fixed leg, which is the right one.
  double lean_deg = 0.0;
  double pelvis_yaw_deg = 0.0;
  double shoulder_yaw_deg = 0.0;
};

double YawDeg(const Vec3& to_left) {
  return kDegreesPerRadian * Atan2(-static_cast<double>(to_left.z), static_cast<double>(to_left.x));
}

Posture PostureOf(const Crouching& person, const PostureSample& sample) {
  const double leg_m = LegLength(person.skeleton, person.rig, sample, Foot::kRight);
  const double cosine =
      (leg_m * leg_m - builtin::kThighM * builtin::kThighM - builtin::kShankM * builtin::kShankM) /
      (2.0 * builtin::kThighM * builtin::kShankM);
  std::array<Vec3, builtin::kFigureJointCount> p;
  std::array<Quat, builtin::kFigureJointCount> rotations;
  ForwardKinematics(person.skeleton, ToPose(sample), p, rotations);
  const Vec3 trunk = p[builtin::kNeck] - p[builtin::kHips];
  return {.knee_deg = kDegreesPerRadian * Acos(std::clamp(cosine, -1.0, 1.0)),
          .lean_deg =
              kDegreesPerRadian * Atan2(static_cast<double>(trunk.z), static_cast<double>(trunk.y)),
          .pelvis_yaw_deg = YawDeg(p[builtin::kLeftUpLeg] - p[builtin::kRightUpLeg]),
          .shoulder_yaw_deg = YawDeg(p[builtin::kLeftArm] - p[builtin::kRightArm])};
}

TEST(GenericStride, WalksUprightEvenIfTheStandCrouches) {
  const Crouching person(0.1, 0.6);
  const Posture stand = PostureOf(person, SampleOf(person.skeleton, person.stand, 0.0));
  ASSERT_GT(stand.knee_deg, 45.0);
  ASSERT_GT(stand.lean_deg, 20.0);
  const StrideModel stride = person.Stride();
  for (double generic = 1.2; generic <= 1.8; generic += 0.1) {
    const Posture posture = PostureOf(person, stride.At(generic));
    EXPECT_LT(posture.knee_deg, 20.0) << generic;
    EXPECT_LT(posture.lean_deg, 12.0) << generic;
    EXPECT_GT(posture.lean_deg, -4.0) << generic;
  }
}

// If the pelvis turns with the leg that swings forward, the shoulders turn the other way.
TEST(GenericStride, ShouldersTurnAgainstThePelvis) {
  const Crouching person(0.0, 0.0);
  const StrideModel stride = person.Stride();
  const Posture start = PostureOf(person, stride.At(0.0));
  const Posture end = PostureOf(person, stride.At(3.0));
  const double pelvis_deg = end.pelvis_yaw_deg - start.pelvis_yaw_deg;
  const double shoulders_deg = end.shoulder_yaw_deg - start.shoulder_yaw_deg;
  EXPECT_GT(std::fabs(pelvis_deg), 2.0);
  EXPECT_GT(std::fabs(shoulders_deg), 1.0);
  EXPECT_LT(pelvis_deg * shoulders_deg, 0.0);
}

}  // namespace
}  // namespace stridewire::complete
