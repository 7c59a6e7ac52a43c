#pragma once

#include <optional>

#include "runtime/movement/movement.h"
#include "runtime/plan/foot_locks.h"
#include "runtime/plan/landing_decision.h"
#include "runtime/plan/plan_scratch.h"
#include "runtime/plan/request_plan.h"
#include "runtime/plan/swing_times.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/leg_rig.h"
#include "runtime/terrain/foot_support.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Target to which a movement should bring the feet.
struct LandingTarget {
  /// Request whose `applied` parameters or, if it has one, whose footprint must be reached exactly.
  const RequestPlan& request;
  /// Terrain; null for level ground at the height that the library and the request determine.
  const Terrain* terrain;
  /// A point on the line along which the body moves. Groups without a sideways parameter are
  /// steered back to that line.
  DVec3 line_m;
};

/// The pose that a movement blends from.
struct BlendSource {
  ConstPoseSpan before;  ///< Blended pose with difference pose, without planting.
  /// The pose kBlendStepS before `before`, if the velocity is kept.
  std::optional<ConstPoseSpan> earlier;
};

/// Planting changes the heading of the library's step by at most this angle to match a requested
/// footprint. For the position see RequestPlan::most_residual_m.
inline constexpr double kMaxFootTurnRad = 0.35;
/// Largest shift of the root for a step that ends in a stand.
inline constexpr double kMaxRootShiftM = 0.4;

/// Input and output of PlanFeet.
struct FootPlanJob {
  const MotionLibrary& library;
  const FootLocks& locks;  ///< Positions of the feet at the start.
  BlendSource source;
  /// Scratch memory, whose cache may only contain rows of this movement.
  FootPlanScratch& scratch;
  PoseSpan pose;       ///< Scratch with one rotation per joint.
  Movement& movement;  ///< Movement to plan. Its weights and heading must be set.
};

/// Plans the feet of a movement. Sets its base position, so that the foot that stays (for a jump:
/// the centre of both feet) is where it stands and nothing drifts, its difference pose relative to
/// the source, and `movement.feet`. Never allocates. Returns the feet of the blended pose with its
/// difference pose at the start of the movement and kBlendStepS later.
std::array<FeetAt, 2> PlanFeet(const FootPlanJob& job, const LandingTarget& target);

/// Repeats a plan from its decisions, with the same bits. The heading change of the movement is not
/// used.
std::array<FeetAt, 2> PlanFeet(const FootPlanJob& job, const LandingDecision& decision);

/// Sets FootTrajectory::settle_lift_m of a planned step on level ground, so that its standing feet
/// do not sink while the difference pose fades out. Call this when the residuals of the plan are
/// set.
void LiftWhileSettling(const FootPlanJob& job);

}  // namespace stridewire
