// AvatarSimulation: rejects steps and jumps that are out of reach, and plans steps with exact
// placement.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/check.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

// Tolerances within which a foot is on its footprint. That of the distance is slightly below the
// documented tolerance of 1 mm.
constexpr double kMetM = 0.9e-3;
constexpr double kMetRad = 1e-3;
// Number of times, from the landing to the end of the step, at which LandingErrorFrom checks the
// pose.
constexpr int kChecks = 5;
// On terrain, planting lifts a sole whose heel or toes are below the ground. A lift up to this
// height does not count as an error.
constexpr double kLiftedM = 0.1;

// A footprint within reach is found iteratively. A step aimed too far lands short of its target. A
// step aimed at that landing place may again land elsewhere, because the library blends a different
// step. Convergence is faster if the target is moved by kOvershoot times the error.
constexpr int kMaxTries = 8;
constexpr double kOvershoot = 1.5;

constexpr double kDegreesPerRadian = 57.29577951308232;

bool IsMet(const FootprintError& missed) {
  return missed.distance_m <= kMetM && missed.turn_rad <= kMetRad;
}

StepMeasures MeasuresOf(const RequestTarget& target, double outward) {
  return {target.vector_m.z, outward * target.vector_m.x, target.vector_m.y, target.turn_rad};
}

// Describes a step or jump, for example "length 0.66 m, turn 0.1 rad": its length, and those other
// measures in which the requested and the nearest movement differ.
std::string MeasuresText(const StepMeasures& step, const FootprintError& missed) {
  constexpr double kVisible = 0.005;
  std::string text;
  const auto append = [&](const char* format, double value) {
    char part[40];
    // Adding 0 turns a rounded -0.0 into 0.
    std::snprintf(part, sizeof part, format, std::round(value * 100.0) / 100.0 + 0.0);
    text += part;
  };
  const auto differs = [&](double StepMeasures::* value) {
    return std::fabs(missed.requested.*value - missed.reached.*value) > kVisible;
  };
  append("length %.4g m", step.length_m);
  if (differs(&StepMeasures::side_m)) append(", side %.4g m", step.side_m);
  if (differs(&StepMeasures::height_m)) append(", height %.4g m", step.height_m);
  if (differs(&StepMeasures::turn_rad)) append(", turn %.4g rad", step.turn_rad);
  return text;
}

}  // namespace

std::string DescribeRejection(const AvatarEvent& event) {
  if (!event.missed) return event.reason;
  const FootprintError& missed = *event.missed;
  char text[201];
  if (!missed.is_footprint) {
    std::snprintf(text, sizeof text, ", %.3g m and %.0f degrees off", missed.distance_m,
                  missed.turn_rad * kDegreesPerRadian);
    return event.reason + (": requested " + MeasuresText(missed.requested, missed)) + "; nearest " +
           MeasuresText(missed.reached, missed) + text;
  }
  const DVec3 nearest = missed.nearest.position_m;
  std::snprintf(text, sizeof text,
                "%s: the %s foot reaches (%.6g, %.6g, %.6g) m heading %.4g rad, %.3g m and %.3g "
                "degrees off",
                event.reason, event.foot == Foot::kLeft ? "left" : "right", nearest.x, nearest.y,
                nearest.z, missed.nearest.heading_rad, missed.distance_m,
                missed.turn_rad * kDegreesPerRadian);
  return text;
}

// Adds the event for a request that is rejected because its plan is out of reach.
void AvatarSimulation::RejectOutOfReach(const MovementRequest& request, const RequestPlan& plan) {
  const MovementKind kind = body_.library->group(plan.group).kind;
  const auto* step = std::get_if<StepRequest>(&request.movement);
  const RequestError error = PlannedError(plan);
  const Foot foot = IsStep(kind) ? MovingFoot(kind) : Foot::kLeft;
  const double outward = foot == Foot::kLeft ? 1.0 : -1.0;
  // The target of a step is relative to the fixed foot and to the heading after the step. The
  // target of a jump is relative to the base frame (RequestTarget).
  const DVec3 from_m = IsStep(kind) ? StandingPosition(OtherFoot(foot)) : base_.position_m;
  const double heading_rad = base_.heading_rad + (IsStep(kind) ? error.reached.turn_rad : 0.0);
  FootprintError missed{.nearest = {from_m + RotateYaw(heading_rad, error.reached.vector_m),
                                    base_.heading_rad + error.reached.turn_rad},
                        .distance_m = error.distance_m,
                        .turn_rad = error.angle_rad,
                        .requested = MeasuresOf(plan.target, outward),
                        .reached = MeasuresOf(error.reached, outward),
                        .is_footprint = step != nullptr && step->at.has_value()};
  if (!plan.is_side_given) missed.requested.side_m = missed.reached.side_m;
  if (options_.terrain != nullptr) {
    missed.requested.height_m = missed.reached.height_m;
    DVec3& nearest_m = missed.nearest.position_m;
    nearest_m.y = options_.terrain->HeightAt(nearest_m.x, nearest_m.z);
  }
  AddEvent({.type = AvatarEventType::kRejected,
            .request_id = request.id,
            .kind = kind,
            .foot = foot,
            .base = base_,
            .code = ErrorCode::kOutOfRange,
            .reason = !IsStep(kind)         ? "the jump is out of reach"
                      : missed.is_footprint ? "the footprint is out of reach"
                                            : "the step is out of reach",
            .missed = missed});
}

// Plans the movement of a request. If the request is out of reach, rejects it, restores the
// previous state and returns false.
bool AvatarSimulation::PlanRequested(const MovementRequest& request, const RequestPlan& plan,
                                     double start_phase, PlanScratch& scratch) {
  const auto* step = std::get_if<StepRequest>(&request.movement);
  if (step == nullptr || !step->exact_only) {
    if (!AllowsNearest(request) && PlannedError(plan).IsTooLarge()) {
      RejectOutOfReach(request, plan);
      return false;
    }
    PlanMovement(plan, start_phase, scratch);
    return true;
  }
  if (!body_.plants_feet) {
    AddEvent({.type = AvatarEventType::kRejected,
              .request_id = request.id,
              .base = base_,
              .reason = kNeedsPlanting});
    return false;
  }
  STRIDEWIRE_CHECK(saved_.size() == 1 && plan.exact.has_value());
  saved_.front().pose = body_.pose;  // Both poses have the same size, so this does not allocate.
  std::swap(body_.movement, saved_.front().movement);
  PlanMovement(plan, start_phase, scratch);
  FootprintError missed = LandingErrorFrom(*plan.exact);
  if (IsMet(missed)) return true;
  missed = NearestInReach(*plan.exact, missed, start_phase, scratch);
  const Foot foot = MovingFoot(group().kind);
  const double outward = foot == Foot::kLeft ? 1.0 : -1.0;
  missed.requested = MeasuresOf(plan.target, outward);
  missed.reached =
      MeasuresOf({RotateYaw(-missed.nearest.heading_rad,
                            missed.nearest.position_m - StandingPosition(OtherFoot(foot))),
                  missed.nearest.heading_rad - base_.heading_rad},
                 outward);
  missed.is_footprint = step->at.has_value();
  AddEvent(
      {.type = AvatarEventType::kRejected,
       .request_id = request.id,
       .kind = group().kind,
       .foot = foot,
       .base = base_,
       .code = ErrorCode::kOutOfRange,
       .reason = missed.is_footprint ? "the footprint is out of reach" : "the step is out of reach",
       .missed = missed});
  std::swap(body_.movement, saved_.front().movement);
  body_.pose = saved_.front().pose;
  return false;
}

// Searches for a footprint close to the requested one that the avatar can reach exactly. Returns
// that footprint and its distance from the requested one.
FootprintError AvatarSimulation::NearestInReach(const Footprint& asked,
                                                const FootprintError& missed, double start_phase,
                                                PlanScratch& scratch) {
  const Foot moving = MovingFoot(group().kind);
  Footprint aim = asked;
  FootprintError error = missed;
  for (int i = 0; i < kMaxTries && !IsMet(error); ++i) {
    const double further = i == 0 ? 1.0 : kOvershoot;
    aim.position_m += further * (error.nearest.position_m - aim.position_m);
    aim.heading_rad += further * (error.nearest.heading_rad - aim.heading_rad);
    const auto plan = PlanRequest(
        {.movement = StepRequest{.foot = moving,
                                 .at = FootprintRequest{aim.position_m, aim.heading_rad},
                                 .exact_only = true}});
    STRIDEWIRE_CHECK(plan.has_value() && plan->exact.has_value());
    PlanMovement(*plan, start_phase, scratch);
    error = LandingErrorFrom(*plan->exact);
  }
  const DVec3 away_m = asked.position_m - error.nearest.position_m;
  return {error.nearest, std::sqrt(glm::dot(away_m, away_m)),
          std::fabs(asked.heading_rad - error.nearest.heading_rad)};
}

// Computes where the planned step places its foot, and how far that is from the requested
// footprint. The errors of the plan are not sufficient: only the planted pose shows that a leg is
// too short for a step up or down. Planting may displace the standing foot instead of the moving
// foot, so the displacement of one foot relative to the other counts if it is larger.
FootprintError AvatarSimulation::LandingErrorFrom(const Footprint& asked) {
  const Skeleton& skeleton = body_.library->skeleton();
  const LegRig& rig = body_.library->leg_rig();
  const Foot moving = MovingFoot(group().kind);
  const auto m = static_cast<std::size_t>(moving);
  const auto x = 1 - m;
  const auto feet_of_pose = [&] {
    std::array<BlendedFoot, 2> feet;
    LegPose leg;
    for (std::size_t f = 0; f < 2; ++f) {
      EvaluateLeg(skeleton, rig, body_.pose, static_cast<Foot>(f), leg);
      feet[f] = FootOf(rig, static_cast<Foot>(f), DVec3(body_.pose.root_position_m), leg);
    }
    return feet;
  };

  GridCache cache(body_.library->layout());
  FootprintError worst{asked};
  const double land_s = body_.movement.feet.foot(moving).land_s;
  const double standing_s = body_.movement.duration_s() - land_s;
  const int checks = standing_s > 0.0 ? kChecks : 1;
  for (int check = 0; check < checks; ++check) {
    const double time_s = land_s + standing_s * check / std::max(checks - 1, 1);
    EvaluateMovement(group(), body_.library->layout(), body_.movement, time_s, cache, body_.pose);
    std::array<BlendedFoot, 2> planned = feet_of_pose();
    for (std::size_t f = 0; f < 2; ++f) {
      planned[f].ball_m +=
          FootOffset(body_.movement, static_cast<Foot>(f), time_s, planned[f].ball_m);
    }
    PlantFeet(rig, body_.movement, time_s, body_.pose);
    const std::array<BlendedFoot, 2> planted = feet_of_pose();
    DVec3 error_m = planted[m].ball_m - planned[m].ball_m;
    const DVec3 from_other_m = error_m - (planted[x].ball_m - planned[x].ball_m);
    if (glm::dot(from_other_m, from_other_m) > glm::dot(error_m, error_m)) error_m = from_other_m;
    if (body_.movement.feet.keeps_above_ground && std::fabs(error_m.y) < kLiftedM) error_m.y = 0.0;
    // The heights of the balls follow the blended pose, so they are compared with the plan instead
    // of the request.
    const DVec3 away_m(asked.position_m.x - planned[m].ball_m.x - error_m.x, -error_m.y,
                       asked.position_m.z - planned[m].ball_m.z - error_m.z);
    const double turn_rad = WrapAngle(asked.heading_rad - planted[m].heading_rad);
    const double distance_m =
        std::sqrt(away_m.x * away_m.x + away_m.y * away_m.y + away_m.z * away_m.z);
    if (distance_m + std::fabs(turn_rad) <= worst.distance_m + worst.turn_rad) continue;
    worst = {
        {asked.position_m - away_m, asked.heading_rad - turn_rad}, distance_m, std::fabs(turn_rad)};
  }
  return worst;
}

}  // namespace stridewire
