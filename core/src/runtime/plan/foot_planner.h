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

/// Where a foot is between two movements, and what planting adds to the blend there.
struct FootLock {
  Footprint print;
  double height_m = 0.0;
  double turn_rad = 0.0;
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);
  double root_weight = 0.5;
};
using FootLocks = std::array<FootLock, 2>;  ///< Indexed by Foot.

/// Feet as the unplanted pose has them, on the ground below them or, without terrain, at height
/// `ground_m`.
[[nodiscard]] FootLocks FootLocksOf(const Skeleton& skeleton, const LegRig& rig, ConstPoseSpan pose,
                                    double ground_m, const Terrain* terrain);

/// How a foot would stand at a place.
[[nodiscard]] FootSupport SupportOf(const Terrain& terrain, const LegRig::Side& side,
                                    const Footprint& print);

/// Makes a movement of one in which both feet stay where they are held.
void StandOn(const FootLocks& locks, Movement& movement);

/// Where a movement is to bring the feet.
struct LandingTarget {
  const RequestPlan& request;  ///< Its applied ends are kept exactly, the footprint if there is one
  const Terrain* terrain;      ///< Null: level where the library and the request say
  /// A point of the line the body goes along, which groups that say nothing of where feet stand
  /// aside keep to.
  DVec3 line_m;
};

/// What a movement goes on from.
struct BlendSource {
  ConstPoseSpan before;  ///< Blended and eased, without planting
  std::optional<ConstPoseSpan>
      earlier;  ///< The same kBlendStepS before, if its speed is to be kept
};

/// A footprint further from where the library's step ends than the request says is approached so
/// far only. A heading is met as far as this.
inline constexpr double kMaxFootTurnRad = 0.35;
/// The root goes no further from where its steps have it, for who is to stand in a place.
inline constexpr double kMaxRootShiftM = 0.4;

/// Plans the feet of a movement that StartMovement has filled, heading and all, and that goes on
/// from `join`. Sets the movement's base position, so that the foot that stays (for a jump: the
/// middle of both) is where it stands and nothing drifts; its difference pose; and `movement.feet`.
///
/// `pose` is scratch with one rotation per joint. The cache of `scratch` may only hold rows of this
/// movement. Never allocates. Returns where the blended and eased pose has the feet when the
/// movement is entered, and kBlendStepS later.
std::array<FeetAt, 2> PlanFeet(const MotionLibrary& library, const FootLocks& locks,
                               const LandingTarget& target, const BlendSource& source,
                               FootPlanScratch& scratch, PoseSpan pose, Movement& movement);

/// What PlanFeet chose for a movement, in terms of which the rest of the plan follows: neither
/// request nor ground are needed to make it again.
struct LandingDecision {
  double extra_turn_rad = 0.0;  ///< Movement::extra_turn_rad
  bool is_on_terrain = false;
  std::array<DVec3, 2> to_m{DVec3(0.0), DVec3(0.0)};  ///< Where feet that move land, by Foot
  // The rest is a step's.
  double turn_rad = 0.0;  ///< Of the foot where it lands, further than the step has it
  double height_m = 0.0;  ///< What is added to the blend's height there
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);  ///< Of the ground there, if it is terrain
  double lift_m = 0.0;                   ///< FootTrajectory::lift_m, 0 if it is none
  DVec3 aside_m = DVec3(0.0);            ///< FootTrajectory::aside_m
  DVec3 root_shift_m = DVec3(0.0);       ///< FootTrajectory::root_shift_m
};

/// What was chosen for a movement whose feet are planned.
[[nodiscard]] LandingDecision DecisionOf(MovementKind kind, const Movement& movement);

/// The same plan, bit by bit, from what was chosen for it. The movement has its weights and
/// heading; the heading change is not needed.
std::array<FeetAt, 2> PlanFeet(const MotionLibrary& library, const FootLocks& locks,
                               const LandingDecision& decision, const BlendSource& source,
                               FootPlanScratch& scratch, PoseSpan pose, Movement& movement);

/// The holds at a time of a planned movement when both feet stand; the pose then, eased but not
/// planted, is `pose`.
[[nodiscard]] FootLocks FootLocksAt(const MotionLibrary& library, const Movement& movement,
                                    double time_s, ConstPoseSpan pose);

/// When the feet that a movement moves leave the ground and stand again, planted or not.
struct SwingTimes {
  double release_s = 0.0;
  double land_s = 0.0;
};
[[nodiscard]] SwingTimes SwingTimesOf(MovementKind kind, const Movement& movement);

}  // namespace stridewire
