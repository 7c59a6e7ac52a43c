#include "runtime/plan/walk_planner.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/trig.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/plan/foot_planner.h"
#include "runtime/plan/walk_steering.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

// A foot within this distance and angle of its footprint at the goal has arrived.
constexpr double kArrivedM = 0.002;
constexpr double kArrivedRad = 0.004;
// The same tolerances without planting, when feet land wherever the blend puts them.
constexpr double kRoughlyArrivedM = 0.15;
constexpr double kRoughlyArrivedRad = 0.25;

// Largest distance between the library's own step and the footprint, which planting distributes
// over the swing. The larger limit applies to small steps and to the second attempt, because
// libraries without steps in place have to turn and close with the steps they have.
constexpr double kMaxErrorM = 0.16;
constexpr double kMaxLooseErrorM = 0.6;
// A step that goes no further forward than this ends with the body above both feet.
constexpr double kForwardM = 0.2;

// Limits on the ground below a sole (FootSupport). They exclude edges, bumps and walls.
constexpr double kLeastCarried = 0.999;
constexpr double kDeepestGapM = 0.04;
constexpr double kHighestRiseM = 0.04;
// An obstacle along a swing may be at most this much higher than both ends of the swing.
constexpr double kMaxHurdleM = 0.25;
constexpr double kHurdleRadiusM = 0.06;

// Radii of the rings of eight alternative footprints around the desired one, closest first.
constexpr std::array<double, 6> kRingsM{0.04, 0.08, 0.12, 0.16, 0.22, 0.28};

// Feet keep this distance from risers in front of their toes and behind their heels, if a shift of
// the footprint makes that possible.
constexpr double kRoomM = 0.02;
constexpr std::array<double, 10> kRoomShiftsM{-0.015, 0.015, -0.03, 0.03,   -0.045,
                                              0.045,  -0.06, 0.06,  -0.075, 0.075};

// After this many alternatives that the library cannot reach, the step is given up.
constexpr int kMaxOutOfReach = 3;

// Variations of a step to try in turn: shorter steps, then steps towards either side.
struct Attempt {
  double part;      // Fraction of the full step length.
  double bend_rad;  // Change of the walking direction, left positive.
};
constexpr std::array<Attempt, 11> kAttempts{{{1.0, 0.0},
                                             {0.75, 0.0},
                                             {0.5, 0.0},
                                             {1.0, 0.5},
                                             {1.0, -0.5},
                                             {0.7, 0.9},
                                             {0.7, -0.9},
                                             {0.3, 0.0},
                                             {0.6, 1.4},
                                             {0.6, -1.4},
                                             {0.15, 0.0}}};

// Within this distance the ground at the goal is checked again, because it may have changed.
constexpr double kGoalInSightM = 1.5;

// A walk makes progress if its remaining distance shrinks by kProgressM. A radian of remaining turn
// counts as kMetresPerRadianLeft.
constexpr double kProgressM = 0.02;
constexpr double kMetresPerRadianLeft = 0.3;

class StepPlanner {
 public:
  StepPlanner(const MotionLibrary& library, const Terrain* terrain, const WalkStance& stance)
      : library_(library),
        profile_(library.locomotion_profile()),
        terrain_(terrain),
        stance_(stance) {}

  void Begin(bool is_strict) {
    is_strict_ = is_strict;
    candidates_ = 0;
  }

  // Plans a step of a foot. Returns nullopt if the library has no such step onto suitable ground.
  std::optional<RequestPlan> Plan(Foot moving, const WalkStep& step) {
    moving_ = moving;
    outward_ = moving == Foot::kLeft ? 1.0 : -1.0;
    fixed_m_ = stance_.feet[static_cast<std::size_t>(OtherFoot(moving))].position_m;
    Footprint wanted{step.print.position_m,
                     UnwrapAngle(step.print.heading_rad, stance_.heading_rad)};
    if (terrain_ == nullptr) return PlanExactStep(Level(wanted), step.root_m);
    if (!step.is_last) wanted = WithRoom(wanted);
    if (IsGood(wanted)) return PlanExactStep(OnGround(wanted), step.root_m);
    if (step.is_last) return std::nullopt;
    int out_of_reach = 0;
    for (const double ring_m : kRingsM) {
      for (int i = 0; i < 8; ++i) {
        // Directions of the alternatives: ahead and behind first, sideways last.
        constexpr std::array<double, 8> kAround{0.0,        kPi,         0.25 * kPi, -0.25 * kPi,
                                                0.75 * kPi, -0.75 * kPi, 0.5 * kPi,  -0.5 * kPi};
        const double way = wanted.heading_rad + kAround[static_cast<std::size_t>(i)];
        Footprint print = wanted;
        print.position_m += RotateYaw(way, DVec3(0.0, 0.0, ring_m));
        print = WithRoom(print);
        if (!KeepsApart(print) || !IsGood(print)) continue;
        if (auto plan = PlanExactStep(OnGround(print), step.root_m)) return plan;
        if (++out_of_reach >= kMaxOutOfReach) return std::nullopt;
      }
    }
    return std::nullopt;
  }

  // Returns true if both feet can stand at their footprints at the goal.
  bool GoalIsGood(const WalkSteering& steering) {
    double heights_m[2];
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const Footprint print = OnGround(steering.GoalPrint(foot));
      if (!Carries(foot, print)) return false;
      heights_m[static_cast<std::size_t>(foot)] = print.position_m.y;
    }
    return std::fabs(heights_m[0] - heights_m[1]) <= kMaxWalkClimbM;
  }

  [[nodiscard]] bool has_seen_bad_ground() const { return has_seen_bad_ground_; }
  [[nodiscard]] bool has_seen_heights() const { return has_seen_heights_; }
  [[nodiscard]] bool is_exhausted() const { return candidates_ >= kMaxWalkCandidates; }

 private:
  static constexpr double kPi = 3.14159265358979323846;

  Footprint Level(Footprint print) const {
    print.position_m.y = fixed_m_.y;
    return print;
  }
  Footprint OnGround(Footprint print) const {
    print.position_m.y = terrain_->HeightAt(print.position_m.x, print.position_m.z);
    return print;
  }

  // Returns true if an alternative footprint is still beside the other foot, not across or far
  // behind it.
  bool KeepsApart(const Footprint& print) const {
    const DVec3 v = RotateYaw(-print.heading_rad, print.position_m - fixed_m_);
    return outward_ * v.x >= 0.08 && outward_ * v.x <= profile_.stand_m + 0.3 &&
           v.z <= profile_.longest_m && v.z >= -std::max(profile_.back_m, 0.15);
  }

  bool Carries(Foot foot, const Footprint& print) const {
    const FootSupport support = SupportOf(*terrain_, library_.leg_rig().side(foot), print);
    return support.normal.y >= kLeastWalkNormalY && support.carried >= kLeastCarried &&
           support.gap_m <= kDeepestGapM && support.rise_m <= kHighestRiseM;
  }

  // Returns true if no higher ground is right in front of the toes or behind the heel.
  bool HasRoom(const Footprint& print) const {
    const LegRig::Side& side = library_.leg_rig().side(moving_);
    const double ground_m = terrain_->HeightAt(print.position_m.x, print.position_m.z);
    for (const double end_m : {side.toe_m, -side.foot_m - kSoleBehindAnkleM}) {
      const DVec3 at = print.position_m + RotateYaw(print.heading_rad, DVec3(0.0, 0.0, end_m));
      if (terrain_->HighestWithin(at.x, at.z, kRoomM) > ground_m + kHighestRiseM) return false;
    }
    return true;
  }

  // Returns the footprint, moved forward or backward if its toes or heel would touch a riser and
  // the tread leaves them room.
  Footprint WithRoom(const Footprint& print) const {
    if (HasRoom(print)) return print;
    for (const double shift_m : kRoomShiftsM) {
      Footprint moved = print;
      moved.position_m += RotateYaw(print.heading_rad, DVec3(0.0, 0.0, shift_m));
      if (HasRoom(moved) && Carries(moving_, moved)) return moved;
    }
    return print;
  }

  bool IsGood(const Footprint& print) {
    if (is_exhausted()) return false;
    ++candidates_;
    const double height_m = terrain_->HeightAt(print.position_m.x, print.position_m.z);
    if (std::fabs(height_m - fixed_m_.y) > kMaxWalkClimbM) {
      has_seen_heights_ = true;
      return false;
    }
    if (!Carries(moving_, print)) {
      has_seen_bad_ground_ = true;
      return false;
    }
    const DVec3 from = stance_.feet[static_cast<std::size_t>(moving_)].position_m;
    const double ends_m = std::max(std::max(from.y, height_m), fixed_m_.y);
    for (const double part : {0.2, 0.4, 0.6, 0.8}) {
      const DVec3 at = from + part * (print.position_m - from);
      if (terrain_->HighestWithin(at.x, at.z, kHurdleRadiusM) > ends_m + kMaxHurdleM) {
        has_seen_heights_ = true;
        return false;
      }
    }
    return true;
  }

  // Plans the library's step to a footprint. Returns nullopt if the step misses the footprint by
  // more than planting can distribute over the swing.
  std::optional<RequestPlan> PlanExactStep(const Footprint& print, const DVec3& root_m) const {
    auto plan =
        PlanFootprint(library_, moving_, print, fixed_m_, stance_.heading_rad, stance_.vector);
    if (!plan) return plan;
    const MotionGroup& group = library_.group(plan->group);
    const DVec3 wanted = RotateYaw(-print.heading_rad, print.position_m - fixed_m_);
    const auto applied_or = [&](ParameterName name, double otherwise) {
      const int l = group.FindParameter(name);
      return l < 0 ? otherwise : plan->applied.values[static_cast<std::size_t>(l)];
    };
    const bool strides = wanted.z > kForwardM;
    const double natural_x =
        outward_ * std::clamp(outward_ * wanted.x, profile_.width_m, profile_.stand_m);
    const double error_x = applied_or(ParameterName::kEndX, natural_x) - wanted.x;
    const double error_z = applied_or(ParameterName::kEndZ, 0.0) - wanted.z;
    const double error_rad = std::fabs(applied_or(ParameterName::kTurn, 0.0) -
                                       (print.heading_rad - stance_.heading_rad));
    if (std::sqrt(error_x * error_x + error_z * error_z) >
            (strides && is_strict_ ? kMaxErrorM : kMaxLooseErrorM) ||
        error_rad > kMaxExtraTurnRad) {
      return std::nullopt;
    }
    plan->most_residual_m = kMaxLooseErrorM;
    if (!strides) plan->root_m = root_m;
    return plan;
  }

  const MotionLibrary& library_;
  const LocomotionProfile& profile_;
  const Terrain* terrain_;
  const WalkStance& stance_;
  Foot moving_ = Foot::kLeft;
  double outward_ = 1.0;
  DVec3 fixed_m_ = DVec3(0.0);
  bool is_strict_ = true;
  int candidates_ = 0;
  bool has_seen_bad_ground_ = false;
  bool has_seen_heights_ = false;
};

WalkDecision Reject(const char* reason) {
  WalkDecision decision;
  decision.outcome = WalkOutcome::kRefused;
  decision.reason = reason;
  return decision;
}

}  // namespace

WalkDecision PlanWalkStep(const MotionLibrary& library, const Terrain* terrain,
                          const WalkRequest& walk, const WalkStance& stance,
                          WalkProgress& progress) {
  STRIDEWIRE_CHECK(progress.next_waypoint <= walk.waypoints_m.size());
  STRIDEWIRE_CHECK(progress.steps >= 0 && progress.steps <= kMaxWalkSteps);
  STRIDEWIRE_CHECK(progress.steps_without >= 0 && progress.steps_without <= kMaxStepsWithout);
  WalkSteering steering(library.locomotion_profile(), walk, stance);
  steering.PassWaypoints(progress.next_waypoint);
  const double arrived_m = stance.is_exact ? kArrivedM : kRoughlyArrivedM;
  const double arrived_rad = stance.is_exact ? kArrivedRad : kRoughlyArrivedRad;
  const bool is_last_leg = progress.next_waypoint >= walk.waypoints_m.size();
  if (is_last_leg && steering.HasArrived(arrived_m, arrived_rad)) return {};

  const double left =
      steering.RemainingM(progress.next_waypoint) + kMetresPerRadianLeft * steering.RemainingRad();
  if (left < progress.least_left - kProgressM) {
    progress.least_left = left;
    progress.steps_without = 0;
  } else if (++progress.steps_without > kMaxStepsWithout) {
    return Reject("the walk makes no progress towards its goal");
  }
  if (++progress.steps > kMaxWalkSteps) {
    return Reject("the walk needs more than 10000 steps");
  }

  StepPlanner planner(library, terrain, stance);
  const bool checks_goal =
      terrain != nullptr && (progress.steps == 1 || (is_last_leg && left < kGoalInSightM));
  if (checks_goal && !planner.GoalIsGood(steering)) {
    return Reject("the ground at the goal is too steep or too uneven to stand on");
  }
  // First try steps that the library has, then steps that planting has to change much.
  for (const bool is_strict : {true, false}) {
    planner.Begin(is_strict);
    for (const Attempt& attempt : kAttempts) {
      for (const Foot moving : steering.FeetToMove(progress.next_waypoint)) {
        const WalkStep step =
            steering.NextStep(moving, progress.next_waypoint, attempt.part, attempt.bend_rad);
        if (auto plan = planner.Plan(moving, step)) {
          return {.outcome = WalkOutcome::kStep, .plan = *plan};
        }
      }
      if (planner.is_exhausted()) break;
    }
  }
  if (planner.has_seen_heights()) {
    return Reject("the ground ahead is too high or too low to step on");
  }
  if (planner.has_seen_bad_ground()) {
    return Reject("the ground ahead is too steep or too uneven for a foot");
  }
  return Reject("the library has no step towards the goal");
}

}  // namespace stridewire
