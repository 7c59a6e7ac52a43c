#pragma once

#include <array>

#include "runtime/movement/movement.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// The root takes this long to come to where the feet of a movement have it.
inline constexpr double kRootShiftS = 0.25;
/// In height this part of a movement, where that is longer: a body climbs as long as its leg
/// stretches.
inline constexpr double kRootRisePart = 0.75;

/// Where the blend has a foot.
struct BlendedFoot {
  DVec3 ball_m = DVec3(0.0);  ///< In the world
  double heading_rad = 0.0;   ///< Less the toe-out of the stand pose
  double flatness = 1.0;      ///< LegPose::Flatness
};

/// Of both feet at a time, indexed by Foot.
using FeetAt = std::array<BlendedFoot, 2>;

/// Corrections of one foot at a time.
struct FootCorrection {
  DVec3 offset_m = DVec3(0.0);
  double turn_rad = 0.0;
  double free_turn_rad = 0.0;  ///< The same had its heading not been held
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);
  double root_weight = 0.0;
  DVec3 root_shift_m = DVec3(0.0);
};

/// How much of `lift_m` is added at a part of the swing: up soon, down late, as who steps over an
/// edge does.
[[nodiscard]] double LiftShare(double swing);

/// The rotation a correction gives the foot, about its ball and in world axes.
[[nodiscard]] Quat TurnOf(const FootCorrection& correction);

/// The corrections of a movement's plan at `time_s` (from its start).
[[nodiscard]] FootCorrection CorrectFoot(const Movement& movement, Foot foot, double time_s,
                                         const BlendedFoot& blended);

/// Corrections of both feet of a blended and eased pose, and where they bring the root.
struct FeetCorrection {
  std::array<FootCorrection, 2> feet;  ///< Indexed by Foot.
  DVec3 root_m = DVec3(0.0);           ///< Added to the root, before legs too short lower it
};
[[nodiscard]] FeetCorrection CorrectFeet(const Movement& movement, double time_s,
                                         const FeetAt& blended);
[[nodiscard]] FeetCorrection CorrectFeet(const Skeleton& skeleton, const LegRig& rig,
                                         const Movement& movement, double time_s,
                                         ConstPoseSpan pose);

/// Makes a movement's plan go on from what the one before corrected when the movement was entered
/// and (second) kBlendStepS earlier. `planned` is what the plan itself corrects when the movement
/// is entered, and kBlendStepS later. The same twice: from rest.
void ContinueFrom(const std::array<FeetCorrection, 2>& before,
                  const std::array<FeetCorrection, 2>& planned, Movement& movement);

/// Makes a movement whose feet are planned set in from a pose that was displayed when it was
/// entered and had no feet planted, the blended and eased one of that time. `pose` is scratch of
/// its size.
void BeginPlantFade(const LegRig& rig, ConstPoseSpan displayed, Movement& movement, PoseSpan pose);

/// The last of planting: gives a pose whose feet are planted back what has not set in yet
/// (FootPlan::plant_fade_s).
void ApplyPlantFade(const LegRig& rig, const Movement& movement, double time_s, PoseSpan pose);

/// A foot of a pose with its root at `root_m`.
[[nodiscard]] BlendedFoot FootOf(const LegRig& rig, Foot foot, const DVec3& root_m,
                                 const LegPose& leg);

/// A movement's plan for FootPlan::packed.
[[nodiscard]] PackedFootPlan PackFootPlan(const Movement& movement);

/// Plants the feet of a movement's blended and eased pose: moves the root by the feet's weighted
/// offsets, lowers it until both legs reach, bends the legs for what remains. Never allocates; same
/// bytes everywhere.
void PlantFeet(const LegRig& rig, const Movement& movement, double time_s, PoseSpan pose);

}  // namespace stridewire
