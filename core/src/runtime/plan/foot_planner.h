#pragma once

#include <optional>

#include "runtime/movement/movement.h"
#include "runtime/plan/plan_scratch.h"
#include "runtime/plan/request_plan.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/leg_rig.h"
#include "runtime/terrain/foot_support.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Position and heading of a foot that stands between two movements, and the corrections that
/// planting adds to the blended foot there.
struct FootLock {
  Footprint print;
  double height_m = 0.0;
  double turn_rad = 0.0;
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);
  double root_weight = 0.5;
};
using FootLocks = std::array<FootLock, 2>;  ///< [foot]

/// Locks the feet where an unplanted pose has them, on the ground below them or, without terrain,
/// at height `ground_m`.
[[nodiscard]] FootLocks FootLocksOf(const Skeleton& skeleton, const LegRig& rig, ConstPoseSpan pose,
                                    double ground_m, const Terrain* terrain);

/// Returns how the ground would support a foot on a footprint.
[[nodiscard]] FootSupport SupportOf(const Terrain& terrain, const LegRig::Side& side,
                                    const Footprint& print);

/// Turns `movement` into one in which both feet stay locked.
void StandOn(const FootLocks& locks, Movement& movement);

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

/// Plans the feet of a movement whose weights and heading are set. Sets its base position, so that
/// the foot that stays (for a jump: the centre of both feet) is where it stands and nothing drifts,
/// its difference pose relative to `source`, and `movement.feet`.
///
/// `pose` is scratch with one rotation per joint. The cache of `scratch` may only contain rows of
/// this movement. Never allocates. Returns the feet of the blended pose with its difference pose at
/// the start of the movement and kBlendStepS later.
std::array<FeetAt, 2> PlanFeet(const MotionLibrary& library, const FootLocks& locks,
                               const LandingTarget& target, const BlendSource& source,
                               FootPlanScratch& scratch, PoseSpan pose, Movement& movement);

/// The decisions of PlanFeet. The rest of the plan follows from them without the request and the
/// terrain.
struct LandingDecision {
  double extra_turn_rad = 0.0;  ///< Movement::extra_turn_rad
  bool is_on_terrain = false;
  /// [foot]: landing positions of the feet that move.
  std::array<DVec3, 2> to_m{DVec3(0.0), DVec3(0.0)};
  // The following members are used for steps only.
  double turn_rad = 0.0;  ///< Turn of the foot at landing, relative to that of the library's step.
  double height_m = 0.0;  ///< Correction of the height of the blended foot at landing.
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);  ///< Ground normal at landing, on terrain.
  std::array<double, 3> lift_m{};        ///< FootTrajectory::lift_m
  DVec3 aside_m = DVec3(0.0);            ///< FootTrajectory::aside_m
  DVec3 root_shift_m = DVec3(0.0);       ///< FootTrajectory::root_shift_m
};

/// Returns the decisions for a movement that has been planned.
[[nodiscard]] LandingDecision DecisionOf(MovementKind kind, const Movement& movement);

/// Repeats a plan from its decisions, with the same bits. The weights and the heading of the
/// movement must be set; its heading change is not used.
std::array<FeetAt, 2> PlanFeet(const MotionLibrary& library, const FootLocks& locks,
                               const LandingDecision& decision, const BlendSource& source,
                               FootPlanScratch& scratch, PoseSpan pose, Movement& movement);

/// Sets FootTrajectory::settle_lift_m of a planned step on level ground, so that its standing feet
/// do not sink while the difference pose fades out. Call this when the residuals of the plan are
/// set. `scratch` and `pose` as for PlanFeet.
void LiftWhileSettling(const MotionLibrary& library, FootPlanScratch& scratch, PoseSpan pose,
                       Movement& movement);

/// Returns the foot locks at a time of a planned movement at which both feet stand. `pose` is the
/// blended pose with its difference pose at that time.
[[nodiscard]] FootLocks FootLocksAt(const MotionLibrary& library, const Movement& movement,
                                    double time_s, ConstPoseSpan pose);

/// Returns the times at which the moving feet leave the ground and land, whether planted or not.
struct SwingTimes {
  double release_s = 0.0;
  double land_s = 0.0;
};
[[nodiscard]] SwingTimes SwingTimesOf(MovementKind kind, const Movement& movement);

/// Returns the time of a phase: 0 is the start of the movement, 1 the release and 2 the landing.
[[nodiscard]] double TimeAtPhase(const SwingTimes& swing, double phase);

}  // namespace stridewire
