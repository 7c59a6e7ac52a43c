#pragma once

#include <array>

#include "stridewire/base/math.h"
#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire::builtin {

/// The generated figure: stature H = 1.75 m, segments as fractions of it after Drillis and Contini
/// 1966 (in Winter, Biomechanics and Motor Control of Human Movement). Lengths in metres.
inline constexpr double kStatureM = 1.75;
inline constexpr double kThighM = 0.245 * kStatureM;
inline constexpr double kShankM = 0.246 * kStatureM;
inline constexpr double kAnkleHeightM = 0.039 * kStatureM;
inline constexpr double kHeelBehindAnkleM = 0.06;
inline constexpr double kBallAheadOfAnkleM = 0.13;
inline constexpr double kToeM = 0.07;  ///< ball to toe tip
inline constexpr double kHipHalfWidthM = 0.085;
inline constexpr double kAnkleHalfWidthM = 0.05;  ///< half the step width
inline constexpr double kStandingHipHeightM = 0.926;

inline constexpr double kDegree = 0.017453292519943295;
inline constexpr double kToeOutRad = 6.0 * kDegree;

/// Joints of the figure, named as CMU's captures name theirs. The ball of the foot is the toe
/// joint and lies in the plane of the sole, so that a flat foot turns about its contact point.
enum JointIndex : int {
  kHips,
  kLeftUpLeg,
  kLeftLeg,
  kLeftFoot,
  kLeftToeBase,
  kRightUpLeg,
  kRightLeg,
  kRightFoot,
  kRightToeBase,
  kLowerBack,
  kSpine,
  kSpine1,
  kNeck,
  kNeck1,
  kHead,
  kLeftShoulder,
  kLeftArm,
  kLeftForeArm,
  kLeftHand,
  kRightShoulder,
  kRightArm,
  kRightForeArm,
  kRightHand,
  kFigureJointCount
};

/// A T-pose facing +Z at identity rotations.
[[nodiscard]] Skeleton MakeFigure();

/// A pose under construction, in double precision. Rotations are local, the root's in the example's
/// frame.
struct FigurePose {
  DVec3 root_m = DVec3(0.0);
  std::array<DQuat, kFigureJointCount> rotations;

  FigurePose() { rotations.fill(DQuat(1.0, 0.0, 0.0, 0.0)); }
};

/// +1 for the left side (+X), -1 for the right.
[[nodiscard]] constexpr double SideSign(Foot foot) { return foot == Foot::kLeft ? 1.0 : -1.0; }

/// Rotations about the axes, radians. RotateX by a positive angle lowers the toes.
[[nodiscard]] DQuat RotateX(double angle_rad);
[[nodiscard]] DQuat RotateY(double angle_rad);
[[nodiscard]] DQuat RotateZ(double angle_rad);

struct FigurePoints {
  std::array<DVec3, kFigureJointCount> positions_m;
  std::array<DQuat, kFigureJointCount> rotations;  ///< in the example's frame
};

[[nodiscard]] FigurePoints PointsOf(const Skeleton& figure, const FigurePose& pose);

/// Centre of mass; segment masses and their centres from Winter's table.
[[nodiscard]] DVec3 BodyCentre(const Skeleton& figure, const FigurePose& pose);

void StorePose(const FigurePose& pose, PoseSpan out);

}  // namespace stridewire::builtin
