#pragma once

#include <array>

#include "runtime/movement/movement.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Minimum time over which the residual of the root (FootPlan::root_residual_m) fades out, in
/// seconds. The horizontal residual fades out over RootApproach::over_s if that is longer.
inline constexpr double kRootShiftS = 0.25;
/// The vertical residual of the root fades out over this fraction of the movement, if that is
/// longer than kRootShiftS, because a body rises for as long as its leg extends.
inline constexpr double kRootRisePart = 0.75;

/// A foot in the blended pose, before planting.
struct BlendedFoot {
  DVec3 ball_m = DVec3(0.0);  ///< Position of the ball in world space.
  double heading_rad = 0.0;   ///< Heading of the foot minus the toe-out of the stand pose.
  double flatness = 1.0;      ///< LegPose::Flatness.
};

/// [foot]: both feet at the same time.
using FeetAt = std::array<BlendedFoot, 2>;

/// Correction of one foot at one time.
struct FootCorrection {
  DVec3 offset_m = DVec3(0.0);  ///< Offset that is added to the blended ball.
  double turn_rad = 0.0;        ///< Turn that is added to the heading of the blended foot.
  double free_turn_rad = 0.0;   ///< Turn that the foot would have without the heading lock.
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);  ///< Normal of the plane to which the foot tilts.
  double root_weight = 0.0;              ///< FootTrajectory::root_weight
  /// Part of FootTrajectory::root_shift_m that is complete at this time.
  DVec3 root_shift_m = DVec3(0.0);
};

/// Returns the fraction of the root's descent (FootTrajectory::root_shift_m.y) that is complete
/// after the fraction `elapsed` of the movement.
[[nodiscard]] double RootSinkShare(double elapsed);

/// Returns the fraction of FootTrajectory::settle_lift_m that is added when the fraction `settled`
/// of the difference pose has faded out.
[[nodiscard]] double SettleLiftShare(double settled);

/// Returns the fraction of FootTrajectory::lift_m[lift] that is added when the fraction `swing` of
/// the swing has elapsed.
[[nodiscard]] double LiftShare(std::size_t lift, double swing);

/// Returns the rotation of a corrected foot about its ball, in world axes.
[[nodiscard]] Quat TurnOf(const FootCorrection& correction);

/// Returns the correction of a foot at `time_s`, according to a movement's plan.
[[nodiscard]] FootCorrection CorrectFoot(const Movement& movement, Foot foot, double time_s,
                                         const BlendedFoot& blended);

/// Returns FootCorrection::offset_m of a foot whose blended ball is at `ball_m`. Faster than
/// CorrectFoot.
[[nodiscard]] DVec3 FootOffset(const Movement& movement, Foot foot, double time_s,
                               const DVec3& ball_m);

/// Corrections of both feet, and the resulting shift of the root.
struct FeetCorrection {
  std::array<FootCorrection, 2> feet;  ///< [foot]
  /// Shift of the root, before it is lowered for legs that are too short.
  DVec3 root_m = DVec3(0.0);
};
/// Returns the corrections at `time_s`. `blended` contains the blended feet at that time.
[[nodiscard]] FeetCorrection CorrectFeet(const Movement& movement, double time_s,
                                         const FeetAt& blended);
/// Same, for the feet of the blended pose `pose`.
[[nodiscard]] FeetCorrection CorrectFeet(const Skeleton& skeleton, const LegRig& rig,
                                         const Movement& movement, double time_s,
                                         ConstPoseSpan pose);

/// Sets the residuals of a movement's plan so that the corrections continue smoothly. `before`
/// contains the corrections of the previous movement at the start of `movement` and kBlendStepS
/// earlier. `planned` contains the corrections of the new plan without residuals, at the start and
/// kBlendStepS later. `blended` contains the feet without corrections at the times of `planned`. If
/// both elements of an array are equal, the velocity is zero. A standing foot continues to descend
/// at 0.5 m/s at most.
void ContinueFrom(const std::array<FeetCorrection, 2>& before,
                  const std::array<FeetCorrection, 2>& planned,
                  const std::array<FeetAt, 2>& blended, Movement& movement);

/// Prepares the plant fade of a planned movement (FootPlan::plant_fade_s): the movement starts with
/// the pose `displayed`, and the changes due to planting fade in. `displayed` has no planted feet
/// and equals the blended pose at the start. `pose` is scratch memory of the same size.
void BeginPlantFade(const LegRig& rig, ConstPoseSpan displayed, Movement& movement, PoseSpan pose);

/// Final step of planting: adds the remaining part of the plant fade (FootPlan::plant_fade_s).
void ApplyPlantFade(const LegRig& rig, const Movement& movement, double time_s, PoseSpan pose);

/// Returns a foot of a pose whose root is at `root_m`.
[[nodiscard]] BlendedFoot FootOf(const LegRig& rig, Foot foot, const DVec3& root_m,
                                 const LegPose& leg);

/// Packs a movement's plan for FootPlan::packed.
[[nodiscard]] PackedFootPlan PackFootPlan(const Movement& movement);

/// Plants the feet of `pose`, which is the result of EvaluateMovement at `time_s`. Does nothing if
/// the movement's feet are not planted. Shifts the root by the weighted corrections of the feet,
/// lowers it until both legs reach their targets, and bends the legs accordingly. Raises the heels
/// of feet whose ankles would bend too far. Never allocates. The result has the same bits on every
/// machine.
void PlantFeet(const LegRig& rig, const Movement& movement, double time_s, PoseSpan pose);

}  // namespace stridewire
