#pragma once

#include <array>

#include "runtime/skeleton/foot_vector.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire::builtin {

/// The generated figure is H = 1.75 m tall. Most segment lengths are fractions of H (Drillis and
/// Contini 1966, in Winter, Biomechanics and Motor Control of Human Movement). Lengths are in
/// metres.
inline constexpr double kStatureM = 1.75;
inline constexpr double kThighM = 0.245 * kStatureM;
inline constexpr double kShankM = 0.246 * kStatureM;
inline constexpr double kAnkleHeightM = 0.039 * kStatureM;
inline constexpr double kHeelBehindAnkleM = 0.06;
inline constexpr double kBallAheadOfAnkleM = 0.13;
inline constexpr double kToeM = 0.07;  ///< Distance from ball to toe tip.
inline constexpr double kHipHalfWidthM = 0.085;
inline constexpr double kAnkleHalfWidthM = 0.05;  ///< Half the step width.
inline constexpr double kStandingHipHeightM = 0.924;

inline constexpr double kDegree = 0.017453292519943295;
inline constexpr double kToeOutRad = 6.0 * kDegree;

/// Joints of the figure, with the names of the CMU captures. The ball of the foot is the toe joint.
/// It is in the plane of the sole, so that a foot whose heel rises rotates about a point on the
/// ground.
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

/// Returns the skeleton. With identity rotations it is in a T-pose and faces +Z.
[[nodiscard]] Skeleton MakeFigure();

/// A pose in double precision. Rotations are relative to the parent. The root is in the frame of
/// the example.
struct FigurePose {
  DVec3 root_m = DVec3(0.0);
  std::array<DQuat, kFigureJointCount> rotations;

  FigurePose() { rotations.fill(DQuat(1.0, 0.0, 0.0, 0.0)); }
};

/// Return rotations about one axis. A positive angle of RotateX lowers the toes.
[[nodiscard]] DQuat RotateX(double angle_rad);
[[nodiscard]] DQuat RotateY(double angle_rad);
[[nodiscard]] DQuat RotateZ(double angle_rad);

/// Positions and rotations of all joints in the frame of the example.
struct FigurePoints {
  std::array<DVec3, kFigureJointCount> positions_m;
  std::array<DQuat, kFigureJointCount> rotations;
};

[[nodiscard]] FigurePoints PointsOf(const Skeleton& figure, const FigurePose& pose);

/// Returns the centre of mass, computed with Winter's table of segment masses and centres.
[[nodiscard]] DVec3 BodyCentre(const Skeleton& figure, const FigurePose& pose);

/// Converts a pose to single precision.
void StorePose(const FigurePose& pose, PoseSpan out);

}  // namespace stridewire::builtin
