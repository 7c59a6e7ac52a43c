#pragma once

#include <optional>

#include "runtime/movement/movement.h"
#include "runtime/plan/foot_locks.h"
#include "runtime/plan/landing_decision.h"
#include "runtime/plan/plan_scratch.h"
#include "runtime/plan/request_plan.h"
#include "runtime/plan/swing_times.h"
#include "runtime/plan/transition_samples.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/leg_rig.h"
#include "runtime/terrain/foot_support.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Target to which a movement should bring the feet.
struct LandingTarget {
  /// Request whose footprint the movement should reach exactly. Without a footprint, the target
  /// follows from RequestPlan::applied.
  const RequestPlan& request;
  /// Terrain. Null: level ground, whose height follows from the library and the request.
  const Terrain* terrain;
  /// A point on the line along which the body moves. In groups without a sideways parameter, the
  /// landing position is shifted by up to 5 cm towards that line.
  DVec3 line_m;
};

/// The pose that a movement blends from.
struct BlendSource {
  ConstPoseSpan before;  ///< Blended pose with difference pose, without planting.
  /// The pose that precedes `before` by kBlendStepS, if the velocity is kept.
  std::optional<ConstPoseSpan> earlier;
};

/// Maximum angle by which planting turns the landing foot of the library's step to match a
/// requested footprint. RequestPlan::most_residual_m is the corresponding limit for its position.
inline constexpr double kMaxFootTurnRad = 0.35;
/// Maximum shift of the root towards RequestPlan::root_m.
inline constexpr double kMaxRootShiftM = 0.4;

/// Input and output of PlanFeet.
struct FootPlanJob {
  const MotionLibrary& library;
  const FootLocks& locks;  ///< Positions of the feet at the start.
  BlendSource source;
  /// Scratch memory. Its cache may only contain rows of this movement.
  FootPlanScratch& scratch;
  PoseSpan pose;       ///< Scratch memory with one rotation per joint.
  Movement& movement;  ///< Movement to plan. Its weights and heading must be set.
  /// Set by PlanFeet, except for stands. The functions that complete the plan read it.
  TransitionSamples& transition;
};

/// Plans the feet of a movement. Sets `movement.feet`, the base position and the difference pose
/// relative to the source. The base position is chosen so that the standing foot (in a jump or
/// stand, the centre of both feet) keeps its place. Walks therefore do not drift. Never allocates.
/// Returns the feet of the blended pose with its difference pose, at the start of the movement and
/// kBlendStepS later.
std::array<FeetAt, 2> PlanFeet(const FootPlanJob& job, const LandingTarget& target);

/// Repeats a plan from its decisions, with the same bits. Does not use the heading change of the
/// movement, which records do not contain.
std::array<FeetAt, 2> PlanFeet(const FootPlanJob& job, const LandingDecision& decision);

/// Sets FootTrajectory::settle_lift_m of a planned step on level ground, so that its standing feet
/// neither sink nor hover while the difference pose fades out. Call it after setting the residuals
/// of the plan.
void LiftWhileSettling(const FootPlanJob& job);

}  // namespace stridewire
