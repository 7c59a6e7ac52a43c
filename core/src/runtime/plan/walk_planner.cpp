#include "runtime/plan/walk_planner.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/check.h"
#include "base/trig.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/plan/foot_planner.h"
#include "runtime/plan/step_planner.h"
#include "runtime/plan/walk_steering.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

// A foot within this distance and angle of its footprint at the goal has arrived.
constexpr double kArrivedM = 0.002;
constexpr double kArrivedRad = 0.004;
// The same tolerances without planting. In this case feet land wherever the blend puts them.
constexpr double kRoughlyArrivedM = 0.15;
constexpr double kRoughlyArrivedRad = 0.25;

// Pace of level steps for which StepPlanner sets none, in walks without a requested speed. People
// who walk to a goal take 100 to 110 steps per minute.
constexpr PlaybackPace kBriskPace{.max_rate = 1.4, .long_s = 0.68, .shortened_s = 0.6};

// Cost of each metre of PlannedStep::error_m above kMaxStepErrorM.
constexpr double kErrorWeight = 0.35;
// Steps are compared by the sum of efforts (WalkSteering::EffortM) and costs, in metres. The main
// term is the effort that remains after the step and the following step. The effort that remains
// after the step alone is added with this weight, so that a walk does not postpone its progress
// for ever.
constexpr double kFirstWeight = 0.2;
// Cost per metre that the body moves. It makes the walk turn in place rather than in a wide curve.
constexpr double kPathWeight = 0.15;
// Cost of a step without progress.
constexpr double kIdleStepM = 0.1;
// Cost of a step after which the other foot cannot continue.
constexpr double kDeadEndM = 1.0;
// Cost of arriving with a heading other than the requested one, per radian. It exceeds the effort
// of a turn, so that the walk continues if the library can turn further.
constexpr double kMissWeight = 0.6;
// Expected duration of a step, for looking ahead.
constexpr double kExpectedStepS = 0.6;

// A variation of the step towards the goal: shorter, or towards either side.
struct Variation {
  double part;      // Fraction of the full step length.
  double bend_rad;  // Change of the walking direction; positive is left.
};
constexpr std::array<Variation, 11> kVariations{{{1.0, 0.0},
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
// Turns of comfortable steps, which do not depend on the goal.
constexpr std::array<double, 5> kComfortableTurnsRad{0.0, 0.3, -0.3, 0.6, -0.6};

// Turns of steps in place.
constexpr std::array<double, 2> kPivotTurnsRad{0.8, -0.8};

// If the remaining effort is below this, the ground at the goal is checked again, because it may
// have changed.
constexpr double kGoalInSightM = 1.5;

// A walk makes progress if its remaining effort decreases by at least this.
constexpr double kProgressM = 0.02;

WalkStance After(const WalkStance& stance, const PlannedStep& step) {
  WalkStance after = stance;
  after.feet[static_cast<std::size_t>(step.moved)] = step.print;
  after.heading_rad = step.heading_rad;
  after.last_moved = step.moved;
  after.vector.left_from_right_m =
      RotateYaw(-step.heading_rad, after.feet[0].position_m - after.feet[1].position_m);
  after.last_step_s = kExpectedStepS;
  after.last_group = static_cast<std::size_t>(step.plan.group);
  after.is_aimed[static_cast<std::size_t>(step.moved)] = step.is_last;
  return after;
}

// Compares steps by the remaining effort of the walk, after the step itself and after the following
// step of the other foot.
class StepComparison {
 public:
  StepComparison(const MotionLibrary& library, const Terrain* terrain, const WalkRequest& walk,
                 std::size_t next_waypoint, double effort_m)
      : library_(library),
        terrain_(terrain),
        walk_(walk),
        next_waypoint_(next_waypoint),
        effort_m_(effort_m) {}

  // Plans a step, and keeps it if its score is better than the best one so far.
  void Consider(StepPlanner& planner, const WalkStance& stance, Foot moving, const WalkStep& step) {
    const auto planned = PlanTurned(planner, moving, step);
    if (!planned) return;
    const double score_m = ScoreM(stance, *planned);
    if (score_m >= best_m_) return;
    best_m_ = score_m;
    best_ = planned;
  }
  // Returns true if the walk makes progress with this step, or with this step and the next one. A
  // foot may step to its place at the goal only if the other foot can follow.
  [[nodiscard]] bool LeadsOn(const WalkStance& stance, const PlannedStep& step) const {
    const LocomotionProfile& profile = library_.locomotion_profile();
    const WalkStance after = After(stance, step);
    const WalkSteering steering(profile, walk_, after);
    if (HasArrived(steering)) return MissCostM(after) < kProgressM;
    if (!step.is_last && steering.EffortM(step.moved, next_waypoint_) < effort_m_ - kProgressM) {
      return true;
    }
    const auto second = NextStep(steering, after, OtherFoot(step.moved));
    if (!second) return false;
    const WalkStance last = After(after, *second);
    const WalkSteering last_steering(profile, walk_, last);
    return HasArrived(last_steering) ||
           last_steering.EffortM(second->moved, next_waypoint_) + ErrorCostM(*second) <
               effort_m_ - kProgressM;
  }
  [[nodiscard]] const std::optional<PlannedStep>& best() const { return best_; }

 private:
  // Plans a step. If the body turns by another angle than requested, the footprint turns with it.
  static std::optional<PlannedStep> PlanTurned(StepPlanner& planner, Foot moving,
                                               const WalkStep& step) {
    if (planner.is_exhausted()) return std::nullopt;
    auto planned = planner.Plan(moving, step, false);
    if (planned && !step.is_last && planned->heading_rad != planned->print.heading_rad) {
      planned = planner.Plan(moving, planner.TurnedWith(*planned), false);
    }
    return planned;
  }

  [[nodiscard]] double ScoreM(const WalkStance& stance, const PlannedStep& first) const {
    const LocomotionProfile& profile = library_.locomotion_profile();
    double score_m = ErrorCostM(first);
    const WalkStance after = After(stance, first);
    const WalkSteering steering(profile, walk_, after);
    const double first_effort_m = steering.EffortM(first.moved, next_waypoint_);
    score_m += kFirstWeight * first_effort_m + kPathWeight * steering.BodiesApartM();
    if (first_effort_m > effort_m_ - kProgressM) score_m += kIdleStepM;
    if (HasArrived(steering)) return score_m + MissCostM(after);
    const Foot other = OtherFoot(first.moved);
    const auto second = NextStep(steering, after, other);
    if (!second) return score_m + first_effort_m + kDeadEndM;
    score_m += ErrorCostM(*second);
    const WalkStance last = After(after, *second);
    const WalkSteering last_steering(profile, walk_, last);
    if (HasArrived(last_steering)) return score_m + MissCostM(last);
    return score_m + last_steering.EffortM(other, next_waypoint_);
  }

  [[nodiscard]] std::optional<PlannedStep> NextStep(const WalkSteering& steering,
                                                    const WalkStance& stance, Foot moving) const {
    StepPlanner planner(library_, terrain_, stance, false);
    return PlanTurned(planner, moving, steering.NextStep(moving, next_waypoint_, 1.0, 0.0));
  }
  [[nodiscard]] bool HasArrived(const WalkSteering& steering) const {
    return next_waypoint_ >= walk_.waypoints_m.size() && steering.IsCloseToGoal();
  }
  [[nodiscard]] double MissCostM(const WalkStance& arrived) const {
    return kMissWeight * std::fabs(WrapAngle(arrived.heading_rad - walk_.heading_rad));
  }
  static double ErrorCostM(const PlannedStep& step) {
    return kErrorWeight * std::max(0.0, step.error_m - kMaxStepErrorM);
  }

  const MotionLibrary& library_;
  const Terrain* terrain_;
  const WalkRequest& walk_;
  std::size_t next_waypoint_;
  double effort_m_;  // Effort before the step.
  std::optional<PlannedStep> best_;
  double best_m_ = HUGE_VAL;
};

// Returns a step in place that turns the body towards the heading at the goal. Returns nullopt if
// the library has none.
std::optional<PlannedStep> TurnAtGoal(StepPlanner& planner, const WalkStance& stance,
                                      const WalkRequest& walk, const WalkSteering& steering) {
  const auto miss_rad = [&](double heading_rad) {
    return std::fabs(WrapAngle(heading_rad - walk.heading_rad));
  };
  for (const Foot foot : {OtherFoot(stance.last_moved), stance.last_moved}) {
    auto planned = planner.Plan(foot, steering.StepToGoal(foot), true);
    if (planned &&
        miss_rad(planned->heading_rad) < miss_rad(stance.heading_rad) - kMaxStepErrorRad) {
      return planned;
    }
  }
  return std::nullopt;
}

// Returns the step that the steering proposes, if the library has it. Otherwise, compares
// variations of that step, comfortable steps and steps in place.
std::optional<PlannedStep> ChooseStep(StepPlanner& planner, StepComparison& comparison,
                                      const WalkStance& stance, WalkSteering& steering,
                                      std::size_t next_waypoint) {
  const std::span<const Foot> feet = steering.FeetToMove(next_waypoint);
  for (const Foot moving : feet) {
    const WalkStep step = steering.NextStep(moving, next_waypoint, 1.0, 0.0);
    const auto planned = planner.Plan(moving, step, true);
    if (planned && comparison.LeadsOn(stance, *planned)) return planned;
  }
  for (const Foot moving : feet) {
    const auto consider = [&](const WalkStep& step) {
      comparison.Consider(planner, stance, moving, step);
    };
    for (const Variation& variation : kVariations) {
      consider(steering.NextStep(moving, next_waypoint, variation.part, variation.bend_rad));
    }
    for (const double turn_rad : kComfortableTurnsRad) {
      consider(steering.ComfortableStep(moving, turn_rad));
    }
    for (const double turn_rad : kPivotTurnsRad) consider(steering.Pivot(moving, turn_rad));
    if (steering.IsGoalNear(moving, next_waypoint)) consider(steering.StepToGoal(moving));
  }
  return comparison.best();
}

WalkDecision Reject(const char* reason) {
  WalkDecision decision;
  decision.outcome = WalkOutcome::kRefused;
  decision.reason = reason;
  return decision;
}

}  // namespace

void WalkPace::Add(const DVec3& position_m, double time_s) {
  Mark mark{.path_m = 0.0, .time_s = time_s};
  if (marks_ > 0) {
    const DVec3 moved_m = position_m - position_m_;
    mark.path_m = last_.back().path_m + std::sqrt(moved_m.x * moved_m.x + moved_m.z * moved_m.z);
  }
  if (marks_ == kStartSteps) started_ = mark;
  std::ranges::rotate(last_, last_.begin() + 1);
  last_.back() = mark;
  position_m_ = position_m;
  ++marks_;
}

double WalkPace::mean_m_s() const {
  if (marks_ <= kStartSteps + kStopSteps + 1) return 0.0;
  const Mark& ended = last_.front();
  return (ended.path_m - started_.path_m) / (ended.time_s - started_.time_s);
}

WalkDecision PlanWalkStep(const MotionLibrary& library, const Terrain* terrain,
                          const WalkRequest& walk, const WalkStance& stance,
                          WalkProgress& progress) {
  STRIDEWIRE_CHECK(progress.next_waypoint <= walk.waypoints_m.size());
  STRIDEWIRE_CHECK(progress.steps >= 0 && progress.steps <= kMaxWalkSteps);
  WalkSteering steering(library.locomotion_profile(), walk, stance);
  const std::size_t waypoint_before = progress.next_waypoint;
  steering.PassWaypoints(progress.next_waypoint);
  const double arrived_m = stance.is_exact ? kArrivedM : kRoughlyArrivedM;
  const double arrived_rad = stance.is_exact ? kArrivedRad : kRoughlyArrivedRad;
  const bool is_last_leg = progress.next_waypoint >= walk.waypoints_m.size();
  if (is_last_leg && steering.HasArrived(arrived_m, arrived_rad)) return {};

  const bool is_close = is_last_leg && steering.IsCloseToGoal();
  const double effort_m = steering.EffortM(stance.last_moved, progress.next_waypoint);
  if (effort_m < progress.least_effort_m - kProgressM ||
      progress.next_waypoint != waypoint_before) {
    progress.least_effort_m = effort_m;
    progress.steps_without = 0;
  } else if (++progress.steps_without >=
             (progress.is_detour ? kMaxDetourSteps : kMaxStepsWithout)) {
    if (is_close) return {};
    return Reject(progress.is_detour ? "the walk makes no progress towards its goal"
                                     : "the library has no step that leads closer to the goal");
  }
  if (++progress.steps > kMaxWalkSteps) {
    return Reject("the walk needs more than 10000 steps");
  }

  StepPlanner planner(library, terrain, stance, true);
  const bool checks_goal =
      terrain != nullptr && (progress.steps == 1 || (is_last_leg && effort_m < kGoalInSightM));
  if (checks_goal && !planner.GoalIsGood(steering)) {
    return Reject("the ground at the goal is too steep or too uneven to stand on");
  }
  StepComparison comparison(library, terrain, walk, progress.next_waypoint, effort_m);
  std::optional<PlannedStep> step;
  if (is_close) {
    step = TurnAtGoal(planner, stance, walk, steering);
    if (!step) return {};
  } else {
    step = ChooseStep(planner, comparison, stance, steering, progress.next_waypoint);
  }
  if (planner.has_seen_bad_ground() || planner.has_seen_heights()) progress.is_detour = true;
  if (step) {
    const double climb_m =
        step->print.position_m.y - stance.feet[static_cast<std::size_t>(step->moved)].position_m.y;
    if (!walk.speed_m_s && step->plan.pace.max_rate == 1.0 &&
        std::fabs(climb_m) <= kUnhurriedClimbM) {
      step->plan.pace = kBriskPace;
    }
    progress.is_aimed[static_cast<std::size_t>(step->moved)] = step->is_last;
    return {.outcome = WalkOutcome::kStep, .plan = step->plan};
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
