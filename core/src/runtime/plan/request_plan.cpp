#include "runtime/plan/request_plan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/library/convex_hull.h"
#include "runtime/library/transition.h"
#include "runtime/skeleton/foot_vector.h"
#include "runtime/weights/measure.h"

namespace stridewire {
namespace {

// Costs are in metres. They are distances between the requested parameters and those that a group
// can produce, multiplied by a weight per parameter.

// The positions of the feet determine the start, so it has a large weight.
constexpr double kStartWeight = 4.0;
// Weight of a parameter that the request does not specify. It is small, so that the parameter
// follows the others.
constexpr double kFreeWeight = 0.02;
// If two groups fit equally well, the one with fewer parameters is preferred, and then the first
// one.
constexpr double kCostPerParameterM = 1e-3;
// Groups whose costs differ by less than this fit equally well. Requests often lie on the border of
// a group, where rounding errors must not choose between it and another group.
constexpr double kTieM = 1e-5;
// A standing avatar moves the foot that moved last, instead of the other one, only if that reduces
// the cost by at least this.
constexpr double kFootPreferenceM = 0.01;

// Additional cost of a group with turn, side or height parameters for a request that specifies none
// of them. Straight walks therefore prefer groups of straight steps.
constexpr double kStraightPreferenceM = 0.15;
// Additional cost of a group whose steps were generated because the captures lack them. Captured
// steps are preferred if they fit nearly as well.
constexpr double kCompletedCostM = 0.02;
// In libraries with generated groups (MotionGroup::is_completed), a step of a captured group costs
// kFarExampleWeight per metre by which its parameters are farther than kNearExampleM from the
// nearest example. With few examples and many parameters, most of the hull is far from all
// examples, and blends there are poor.
constexpr double kNearExampleM = 0.15;
constexpr double kFarExampleWeight = 0.5;
// Additional cost per metre outside the hull of the examples, where requests may extrapolate.
constexpr double kOutsideWeight = 0.25;
// Tolerances for the start of a step in groups without a start parameter for side or height. Such
// groups assume that the feet are placed as in the stand pose. The side tolerance is large, because
// people stand with their feet wider apart than they walk. The height tolerance covers the roll of
// the feet.
constexpr double kStartSlackM = 0.12;
constexpr double kLevelSlackM = 0.05;
// Cost in metres per radian of turn if no turn was requested. It is high, because unwanted turns
// add up over a walk.
constexpr double kStraightMetresPerRadian = 2.0;
// Weights for steps to a footprint. A sideways error has a smaller weight, because planting
// corrects it during the swing. A turn has a larger weight, because planting can correct only a
// small part of it.
constexpr double kExactSideWeight = 0.4;
constexpr double kExactMetresPerRadian = 1.0;
// A wrong landing height leaves the foot above or below the ground, which is worse than a wrong
// distance.
constexpr double kHeightWeight = 4.0;
// Weight of the heights at the start and end of a climbing step to a requested footprint, if the
// best step misses it by more than kMaxClimbMissM horizontally. Planting corrects the height of the
// foot. A level step that planting lifts looks better than a climbing step whose length does not
// fit.
constexpr double kClimbWeight = 0.5;
constexpr double kMaxClimbMissM = 0.16;
constexpr double kChangeM = 1e-6;

// Maximum transition distance between movements that may follow each other. Measured distances are
// at most 0.125 m for captured movements that match, and more than 0.2 m for a stride followed by a
// movement that starts with the feet together. In some captures, no movement starts close to the
// stand pose, so the limit is at least kMaxTransitionOfStand times the distance from the stand.
constexpr float kMaxTransitionM = 0.15f;
constexpr float kMaxTransitionOfStand = 1.5f;

// In walks, a group of a library with generated groups costs kTransitionWeight per metre by which
// its Transition::distance_m from the previous movement exceeds kFreeTransitionM. Otherwise, if the
// captured steps of a library are crouched and its generated steps upright, the body would rise and
// fall from step to step.
constexpr double kTransitionWeight = 0.5;
constexpr double kFreeTransitionM = 0.2;

// The movement before a step.
struct Previous {
  std::size_t group = 0;  // The number of groups after a stand.
  bool must_fit = false;  // True if only groups that may follow it (MayFollow) are considered.
};

// Goal for one parameter. If `given` is false, the request does not specify it, and any value
// within the range of the examples is acceptable.
struct ParameterGoal {
  double value = 0.0;
  bool given = false;
  double weight = 1.0;
  // True if no value is requested, but the value of the stand pose is preferred.
  bool prefers_stand_pose = false;
};
using ParameterGoals = std::array<ParameterGoal, kParameterNameCount>;

ParameterGoal& At(ParameterGoals& goals, ParameterName name) {
  return goals[static_cast<std::size_t>(name)];
}

// Returns true if a group has parameters other than those of straight steps on level ground.
bool IsGeneral(const MotionGroup& group) {
  for (const ParameterName name :
       {ParameterName::kTurn, ParameterName::kStartX, ParameterName::kEndX, ParameterName::kStartY,
        ParameterName::kEndY, ParameterName::kHeight}) {
    if (group.FindParameter(name) >= 0) return true;
  }
  return false;
}

// Returns the distance from a target to the bounding box of a group's examples, enlarged by
// `growth`. It is a cheap lower bound of the distance to their hull.
double DistanceOutsideRange(const MotionGroup& group, std::span<const double> metric,
                            std::span<const double> target, double growth) {
  // Tolerance for the different rounding of parameter ranges and examples.
  constexpr double kSlack = 1e-6;
  double sum = 0.0;
  for (std::size_t l = 0; l < target.size(); ++l) {
    const Parameter& parameter = group.parameters[l];
    const double more = growth * (parameter.max - parameter.min) + kSlack;
    const double outside = metric[l] * std::max({0.0, parameter.min - more - target[l],
                                                 target[l] - parameter.max - more});
    sum += outside * outside;
  }
  return std::sqrt(sum);
}

// Returns the additional cost of a captured group in a library with generated groups, for steps
// with these parameters (see kNearExampleM).
double FarFromExamplesCost(const MotionGroup& group, std::span<const double> values) {
  double nearest = HUGE_VAL;
  for (int e = 0; e < group.example_count; ++e) {
    const auto site = group.site(e);
    double sum = 0.0;
    for (std::size_t l = 0; l < values.size(); ++l) {
      const bool is_turn = group.parameters[l].name == ParameterName::kTurn;
      const double away = (is_turn ? kMetresPerRadian : 1.0) * (values[l] - site[l]);
      sum += away * away;
    }
    nearest = std::min(nearest, sum);
  }
  return kFarExampleWeight * std::max(0.0, std::sqrt(nearest) - kNearExampleM);
}

// Plans a request in one group. Returns nullopt if its cost plus `group_cost_m` is not less than
// `best_cost_m`.
std::optional<RequestPlan> PlanInGroup(const MotionLibrary& library, int group_index,
                                       const ParameterGoals& goals, double stand_side_m,
                                       double group_cost_m, double best_cost_m,
                                       bool is_completed_library) {
  const MotionGroup& group = library.group(group_index);
  const std::size_t d = group.parameters.size();
  RequestPlan plan;
  plan.group = group_index;
  plan.requested.count = plan.applied.count = static_cast<int>(d);
  std::array<double, kMaxParameters> metric_room{};
  std::array<bool, kParameterNameCount> is_spanned{};
  for (std::size_t l = 0; l < d; ++l) {
    const auto name = static_cast<std::size_t>(group.parameters[l].name);
    const ParameterGoal& goal = goals[name];
    is_spanned[name] = true;
    metric_room[l] = goal.given ? goal.weight : kFreeWeight;
    plan.requested.values[l] = goal.given ? goal.value : group.parameters[l].centre;
    if (goal.prefers_stand_pose) {
      plan.requested.values[l] =
          std::clamp(stand_side_m, group.parameters[l].min, group.parameters[l].max);
    }
  }

  // If the group lacks a requested parameter, its steps have the neutral value of that parameter.
  double missed_m = 0.0;
  for (const ParameterName name :
       {ParameterName::kEndX, ParameterName::kEndY, ParameterName::kTurn, ParameterName::kHeight}) {
    const auto i = static_cast<std::size_t>(name);
    if (!goals[i].given || is_spanned[i]) continue;
    const double neutral = name == ParameterName::kEndX ? stand_side_m : 0.0;
    const double missed = goals[i].weight * std::fabs(goals[i].value - neutral);
    if (missed > kChangeM) plan.clamped = true;
    missed_m += missed;
  }
  double start_error_m = 0.0;
  for (const ParameterName name : {ParameterName::kStartX, ParameterName::kStartY}) {
    const auto i = static_cast<std::size_t>(name);
    if (!goals[i].given || is_spanned[i]) continue;
    const double neutral = name == ParameterName::kStartX ? stand_side_m : 0.0;
    start_error_m +=
        goals[i].weight *
        std::max(0.0, std::fabs(goals[i].value - neutral) -
                          (name == ParameterName::kStartX ? kStartSlackM : kLevelSlackM));
  }

  const std::span<const double> target = std::span(plan.requested.values).first(d);
  const std::span<const double> metric = std::span(metric_room).first(d);
  // Projecting onto a hull is slow. A lower bound of the cost excludes most groups without
  // projection.
  const double distance_bound_m = DistanceOutsideRange(group, metric, target, kHullGrowth);
  const double cost_bound_m =
      distance_bound_m + kOutsideWeight * DistanceOutsideRange(group, metric, target, 0.0);
  if (cost_bound_m + missed_m + start_error_m + group_cost_m >= best_cost_m) return std::nullopt;

  const std::span<const double> examples =
      group.sites.first(static_cast<std::size_t>(group.example_count) * d);
  std::array<double, kMaxParameters> inside{};
  const double outside_m =
      ProjectOntoHull(examples, metric, 0.0, target, std::span(inside).first(d));
  plan.extrapolated = outside_m > kChangeM;
  if (outside_m == 0.0) {
    std::ranges::copy(target, plan.applied.values.begin());
  } else {
    // The order of additions is that of plan.cost_m below, so that rounding cannot make the bound
    // larger than the cost.
    const double better_bound_m =
        distance_bound_m + missed_m + kOutsideWeight * outside_m + start_error_m;
    if (better_bound_m + group_cost_m >= best_cost_m) return std::nullopt;
    plan.distance_m = ProjectOntoHull(examples, metric, kHullGrowth, target,
                                      std::span(plan.applied.values).first(d));
  }
  for (std::size_t l = 0; l < d; ++l) {
    const auto name = static_cast<std::size_t>(group.parameters[l].name);
    if (!goals[name].given) plan.requested.values[l] = plan.applied.values[l];
    if (std::fabs(plan.requested.values[l] - plan.applied.values[l]) > kChangeM) {
      plan.clamped = true;
    }
  }
  plan.distance_m += missed_m;
  plan.cost_m = plan.distance_m + kOutsideWeight * outside_m + start_error_m;
  if (is_completed_library && !group.is_completed) {
    plan.cost_m += FarFromExamplesCost(group, std::span(plan.applied.values).first(d));
  }
  if (plan.cost_m + group_cost_m >= best_cost_m) return std::nullopt;
  return plan;
}

// Returns the additional cost of group `to` in a walk after group `from` (see kTransitionWeight).
double TransitionCost(const MotionLibrary& library, std::size_t from, std::size_t to) {
  const Transition* transition = library.FindTransition(from, to);
  if (transition == nullptr) return 0.0;
  return kTransitionWeight * std::max(0.0, double{transition->distance_m} - kFreeTransitionM);
}

std::optional<RequestPlan> BestPlan(const MotionLibrary& library, MovementKind kind,
                                    const ParameterGoals& goals, double stand_side_m,
                                    bool is_straight, const std::optional<Previous>& previous) {
  std::optional<RequestPlan> best;
  double best_cost_m = HUGE_VAL;
  const bool is_completed_library =
      IsStep(kind) && std::ranges::any_of(library.groups(), &MotionGroup::is_completed);
  for (std::size_t g = 0; g < library.groups().size(); ++g) {
    const MotionGroup& group = library.groups()[g];
    if (group.kind != kind) continue;
    if (previous && previous->must_fit && !MayFollow(library, previous->group, g)) continue;
    double group_cost_m = kCostPerParameterM * group.parameter_count();
    if (is_straight && IsGeneral(group)) group_cost_m += kStraightPreferenceM;
    if (group.is_completed) group_cost_m += kCompletedCostM;
    if (previous && !previous->must_fit && is_completed_library) {
      group_cost_m += TransitionCost(library, previous->group, g);
    }
    const auto plan = PlanInGroup(library, static_cast<int>(g), goals, stand_side_m, group_cost_m,
                                  best_cost_m - kTieM, is_completed_library);
    if (!plan) continue;
    STRIDEWIRE_CHECK(plan->cost_m + group_cost_m < best_cost_m);
    best_cost_m = plan->cost_m + group_cost_m;
    best = plan;
  }
  return best;
}

// Returns the horizontal distance between the requested and the applied end of a step.
double HorizontalMissM(const MotionGroup& group, const RequestPlan& plan) {
  double squared = 0.0;
  for (const ParameterName name : {ParameterName::kEndX, ParameterName::kEndZ}) {
    const int l = group.FindParameter(name);
    if (l < 0) continue;
    const auto i = static_cast<std::size_t>(l);
    const double miss_m = plan.requested.values[i] - plan.applied.values[i];
    squared += miss_m * miss_m;
  }
  return std::sqrt(squared);
}

// Implements PlanStep. `climb_weight` is the weight of the heights at the start and end of climbing
// steps.
std::optional<RequestPlan> PlanStepWith(double climb_weight, const MotionLibrary& library,
                                        const StepRequest& request, const FootState& feet,
                                        Foot last_moved, bool standing,
                                        const std::optional<Previous>& previous) {
  const FootState stand{FootVector(library.skeleton(), library.stand_pose(), Foot::kLeft, 0.0)};
  const auto plan_foot = [&](Foot foot) {
    const DVec3 start = feet.Vector(foot);
    const double outward = foot == Foot::kLeft ? 1.0 : -1.0;
    const bool is_wide = std::fabs(start.x - stand.Vector(foot).x) > kStartSlackM;
    const bool climbs =
        request.at && (request.height_m != 0.0 || std::fabs(start.y) > kLevelSlackM);
    ParameterGoals goals;
    At(goals, ParameterName::kStartX) = {start.x, true, kStartWeight};
    At(goals, ParameterName::kStartY) = {start.y, true, climbs ? climb_weight : kStartWeight};
    At(goals, ParameterName::kStartZ) = {start.z, true, kStartWeight};
    At(goals, ParameterName::kEndX) = {
        outward * request.side_m.value_or(0.0), request.side_m.has_value(),
        request.at ? kExactSideWeight : 1.0, !request.side_m && is_wide};
    At(goals, ParameterName::kEndY) = {request.height_m, true,
                                       climbs ? climb_weight : kHeightWeight};
    At(goals, ParameterName::kEndZ) = {request.length_m, true, 1.0};
    At(goals, ParameterName::kTurn) = {request.turn_rad, true,
                                       request.at                ? kExactMetresPerRadian
                                       : request.turn_rad == 0.0 ? kStraightMetresPerRadian
                                                                 : kMetresPerRadian};
    const bool is_straight = request.turn_rad == 0.0 && request.height_m == 0.0 && !request.side_m;
    auto plan =
        BestPlan(library, StepKind(foot), goals, stand.Vector(foot).x, is_straight, previous);
    if (plan) {
      plan->is_side_given = request.side_m.has_value();
      plan->turn_rad = request.turn_rad;
      plan->target = {.vector_m = {request.side_m ? outward * *request.side_m : start.x,
                                   request.height_m, request.length_m},
                      .turn_rad = request.turn_rad};
    }
    return plan;
  };

  if (request.foot) return plan_foot(*request.foot);
  const std::optional<RequestPlan> expected = plan_foot(OtherFoot(last_moved));
  if (expected && !standing) return expected;
  const std::optional<RequestPlan> other = plan_foot(last_moved);
  if (!expected) return other;
  if (!other || other->cost_m > expected->cost_m - kFootPreferenceM) return expected;
  return other;
}

}  // namespace

std::optional<RequestPlan> PlanStep(const MotionLibrary& library, const StepRequest& request,
                                    const FootState& feet, Foot last_moved, bool standing,
                                    std::optional<std::size_t> after) {
  std::optional<Previous> previous;
  if (after) previous = Previous{.group = *after, .must_fit = true};
  return PlanStepWith(kHeightWeight, library, request, feet, last_moved, standing, previous);
}

bool MayFollow(const MotionLibrary& library, std::size_t from, std::size_t to) {
  const std::size_t stand = library.groups().size();
  const Transition* transition = library.FindTransition(from, to);
  if (transition == nullptr || from == stand) return true;
  return transition->distance_m <=
         std::max(kMaxTransitionM,
                  kMaxTransitionOfStand * library.FindTransition(stand, to)->distance_m);
}

std::optional<RequestPlan> PlanFootprint(const MotionLibrary& library, Foot foot,
                                         const Footprint& print, const DVec3& fixed_m,
                                         double heading_rad, const FootState& feet,
                                         const FootprintOrigin& origin) {
  const DVec3 vector = RotateYaw(-print.heading_rad, print.position_m - fixed_m);
  StepRequest step;
  step.foot = foot;
  step.at = FootprintRequest{print.position_m, print.heading_rad};
  step.length_m = vector.z;
  step.side_m = foot == Foot::kLeft ? vector.x : -vector.x;
  step.height_m = GroundRise(vector.y);
  step.turn_rad = print.heading_rad - heading_rad;
  std::optional<Previous> previous;
  if (origin.after) previous = Previous{.group = *origin.after, .must_fit = false};
  std::optional<RequestPlan> plan =
      PlanStepWith(kHeightWeight, library, step, feet, OtherFoot(foot), false, previous);
  if (plan && !origin.is_walk &&
      HorizontalMissM(library.group(plan->group), *plan) > kMaxClimbMissM) {
    plan = PlanStepWith(kClimbWeight, library, step, feet, OtherFoot(foot), false, std::nullopt);
  }
  if (plan) plan->exact = print;
  return plan;
}

std::optional<RequestPlan> PlanJump(const MotionLibrary& library, const JumpRequest& request) {
  ParameterGoals goals;
  At(goals, ParameterName::kLength) = {request.length_m, true, 1.0};
  At(goals, ParameterName::kHeight) = {request.height_m, true, 1.0};
  At(goals, ParameterName::kTurn) = {request.turn_rad, true, kMetresPerRadian};
  auto plan = BestPlan(library, MovementKind::kJump, goals, 0.0,
                       request.turn_rad == 0.0 && request.height_m == 0.0, std::nullopt);
  if (plan) {
    plan->target = {.vector_m = {0.0, request.height_m, request.length_m},
                    .turn_rad = request.turn_rad};
  }
  return plan;
}

double NaturalTurn(const MotionGroup& group, const ParameterValues& values) {
  const int turn = group.FindParameter(ParameterName::kTurn);
  if (turn >= 0) return values.values[static_cast<std::size_t>(turn)];
  double sum_rad = 0.0;
  double weights = 0.0;
  for (int s = 0; s < group.example_count; ++s) {
    const auto site = group.site(s);
    // Keeps the weight of an example finite if it has exactly these parameters.
    double squared = 1e-6;
    for (std::size_t l = 0; l < site.size(); ++l) {
      const double away = (values.values[l] - site[l]) / group.parameters[l].scale;
      squared += away * away;
    }
    weights += 1.0 / squared;
    sum_rad += group.heading_change_rad[static_cast<std::size_t>(s)] / squared;
  }
  return sum_rad / weights;
}

Status ValidateRequest(const MotionLibrary& library, const MovementRequest& request) {
  const auto within = [](double value, double limit) {
    return std::isfinite(value) && std::fabs(value) <= limit;
  };
  const auto is_place = [&](const DVec3& place) {
    return within(place.x, kMaxWalkPositionM) && within(place.y, kMaxWalkPositionM) &&
           within(place.z, kMaxWalkPositionM);
  };
  const auto has_kind = [&](MovementKind kind) {
    return std::any_of(library.groups().begin(), library.groups().end(),
                       [&](const MotionGroup& group) { return group.kind == kind; });
  };
  if (const auto* step = std::get_if<StepRequest>(&request.movement)) {
    if (!within(step->length_m, kMaxRequestLengthM)) {
      return Fail(ErrorCode::kOutOfRange, "length_m: expected a number within 10 m", "step");
    }
    if (step->side_m && !within(*step->side_m, kMaxRequestLengthM)) {
      return Fail(ErrorCode::kOutOfRange, "side_m: expected a number within 10 m", "step");
    }
    if (!within(step->height_m, kMaxRequestLengthM)) {
      return Fail(ErrorCode::kOutOfRange, "height_m: expected a number within 10 m", "step");
    }
    if (!within(step->turn_rad, kMaxRequestTurnRad)) {
      return Fail(ErrorCode::kOutOfRange, "turn_rad: expected a number within 3.2 rad", "step");
    }
    if (step->at && !is_place(step->at->position_m)) {
      return Fail(ErrorCode::kOutOfRange, "at_m: expected numbers within 1000000 m", "step");
    }
    if (step->at && !within(step->at->heading_rad.value_or(0.0), kMaxWalkHeadingRad)) {
      return Fail(ErrorCode::kOutOfRange, "heading_rad: expected a number within 10000 rad",
                  "step");
    }
    if (step->exact_only && step->allow_nearest) {
      return Fail(ErrorCode::kInvalidArgument, "exact_only excludes allow_nearest", "step");
    }
    const bool found =
        step->foot ? has_kind(StepKind(*step->foot))
                   : has_kind(MovementKind::kStepLeft) || has_kind(MovementKind::kStepRight);
    if (!found) return Fail(ErrorCode::kUnsupported, "the library has no such step", "step");
  } else if (const auto* jump = std::get_if<JumpRequest>(&request.movement)) {
    if (!within(jump->length_m, kMaxRequestLengthM)) {
      return Fail(ErrorCode::kOutOfRange, "length_m: expected a number within 10 m", "jump");
    }
    if (!within(jump->height_m, kMaxRequestLengthM)) {
      return Fail(ErrorCode::kOutOfRange, "height_m: expected a number within 10 m", "jump");
    }
    if (!within(jump->turn_rad, kMaxRequestTurnRad)) {
      return Fail(ErrorCode::kOutOfRange, "turn_rad: expected a number within 3.2 rad", "jump");
    }
    if (!has_kind(MovementKind::kJump)) {
      return Fail(ErrorCode::kUnsupported, "the library has no jump", "jump");
    }
  } else if (const auto* walk = std::get_if<WalkRequest>(&request.movement)) {
    if (!is_place(walk->position_m)) {
      return Fail(ErrorCode::kOutOfRange, "position_m: expected numbers within 1000000 m",
                  "walk_to");
    }
    if (!within(walk->heading_rad, kMaxWalkHeadingRad)) {
      return Fail(ErrorCode::kOutOfRange, "heading_rad: expected a number within 10000 rad",
                  "walk_to");
    }
    if (walk->waypoints_m.size() > kMaxWaypoints) {
      return Fail(ErrorCode::kOutOfRange, "waypoints_m: expected at most 64 points", "walk_to");
    }
    if (!std::all_of(walk->waypoints_m.begin(), walk->waypoints_m.end(), is_place)) {
      return Fail(ErrorCode::kOutOfRange, "waypoints_m: expected numbers within 1000000 m",
                  "walk_to");
    }
    if (walk->speed_m_s &&
        !(*walk->speed_m_s >= kMinWalkSpeedMPerS && *walk->speed_m_s <= kMaxWalkSpeedMPerS)) {
      return Fail(ErrorCode::kOutOfRange, "speed_m_s: expected a number from 0.05 to 5", "walk_to");
    }
    if (!has_kind(MovementKind::kStepLeft) || !has_kind(MovementKind::kStepRight)) {
      return Fail(ErrorCode::kUnsupported, "the library does not have steps of both feet",
                  "walk_to");
    }
  } else if (const auto* stand = std::get_if<StandRequest>(&request.movement)) {
    if (!(stand->seconds >= 0.0 && stand->seconds <= kMaxStandS)) {
      return Fail(ErrorCode::kOutOfRange, "seconds: expected a number from 0 to 3600", "stand");
    }
  }
  return {};
}

}  // namespace stridewire
