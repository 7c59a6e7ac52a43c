#include "runtime/plan/request_error.h"

#include <algorithm>
#include <cmath>

#include "base/trig.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/plan/foot_planner.h"

namespace stridewire {
namespace {

// If the requested path is shorter than this, its direction does not matter.
constexpr double kShortestPathM = 0.15;
// Places closer than this are the same, whatever the directions of the paths to them.
constexpr double kSamePlaceM = 0.05;

double Horizontal(const DVec3& v) { return std::sqrt(v.x * v.x + v.z * v.z); }

// Returns the result of a step before planting corrects it.
RequestTarget StepResult(const MotionLibrary& library, const RequestPlan& plan, Foot moving) {
  const MotionGroup& group = library.group(plan.group);
  const LocomotionProfile& profile = library.locomotion_profile();
  const auto applied_or = [&](ParameterName name, double otherwise) {
    const int l = group.FindParameter(name);
    return l < 0 ? otherwise : plan.applied.values[static_cast<std::size_t>(l)];
  };
  const double outward = moving == Foot::kLeft ? 1.0 : -1.0;
  const double natural_x =
      outward * std::clamp(outward * plan.target.vector_m.x, profile.width_m, profile.stand_m);
  return {.vector_m = {applied_or(ParameterName::kEndX, natural_x),
                       applied_or(ParameterName::kEndY, 0.0),
                       applied_or(ParameterName::kEndZ, plan.target.vector_m.z)},
          .turn_rad = NaturalTurn(group, plan.applied)};
}

RequestError StepError(const MotionLibrary& library, const RequestPlan& plan, const FootState& feet,
                       const LandingConditions& conditions) {
  const Foot moving = MovingFoot(library.group(plan.group).kind);
  RequestTarget requested = plan.target;
  RequestError error{.reached = StepResult(library, plan, moving)};
  RequestTarget& reached = error.reached;
  if (!plan.is_side_given) requested.vector_m.x = reached.vector_m.x;
  if (conditions.has_terrain) requested.vector_m.y = reached.vector_m.y = 0.0;
  if (conditions.plants_feet) {
    reached.turn_rad += std::clamp(requested.turn_rad - reached.turn_rad, -plan.max_extra_turn_rad,
                                   plan.max_extra_turn_rad);
  }

  // Landing places relative to the fixed foot and to the heading at the start.
  const DVec3 requested_m = RotateYaw(requested.turn_rad, requested.vector_m);
  DVec3 reached_m = RotateYaw(reached.turn_rad, reached.vector_m);
  DVec3 missed_m = reached.vector_m - requested.vector_m;
  double turn_error_rad = std::fabs(reached.turn_rad - requested.turn_rad);
  if (plan.exact) {
    missed_m = reached_m - requested_m;
    if (conditions.plants_feet) {  // Planting moves and turns the foot to the footprint.
      const double length_m = Horizontal(missed_m);
      const double remaining =
          std::max(0.0, length_m - plan.most_residual_m) / std::max(length_m, 1e-9);
      missed_m.x *= remaining;
      missed_m.z *= remaining;
      turn_error_rad = std::max(0.0, turn_error_rad - kMaxFootTurnRad);
    }
    reached_m = requested_m + missed_m;
    reached.vector_m = RotateYaw(-reached.turn_rad, reached_m);
  }
  error.distance_m = std::sqrt(glm::dot(missed_m, missed_m));
  error.angle_rad = turn_error_rad;
  if (error.distance_m > kSamePlaceM) {
    const DVec3 start_m = feet.Vector(moving);
    error.angle_rad =
        std::max(error.angle_rad, DirectionError(requested_m - start_m, reached_m - start_m));
  }
  return error;
}

RequestError JumpError(const MotionLibrary& library, const RequestPlan& plan,
                       const LandingConditions& conditions) {
  const MotionGroup& group = library.group(plan.group);
  const auto applied_or_0 = [&](ParameterName name) {
    const int l = group.FindParameter(name);
    return l < 0 ? 0.0 : plan.applied.values[static_cast<std::size_t>(l)];
  };
  DVec3 requested_m = plan.target.vector_m;
  RequestError error;
  error.reached = {
      .vector_m = {0.0, applied_or_0(ParameterName::kHeight), applied_or_0(ParameterName::kLength)},
      .turn_rad = NaturalTurn(group, plan.applied)};
  DVec3& reached_m = error.reached.vector_m;
  if (conditions.has_terrain) requested_m.y = reached_m.y = 0.0;
  const DVec3 missed_m = reached_m - requested_m;
  error.distance_m = std::sqrt(glm::dot(missed_m, missed_m));
  error.angle_rad = std::fabs(error.reached.turn_rad - plan.target.turn_rad);
  if (error.distance_m > kSamePlaceM) {
    error.angle_rad = std::max(error.angle_rad, DirectionError(requested_m, reached_m));
  }
  return error;
}

}  // namespace

RequestError ErrorOf(const MotionLibrary& library, const RequestPlan& plan, const FootState& feet,
                     const LandingConditions& conditions) {
  return IsStep(library.group(plan.group).kind) ? StepError(library, plan, feet, conditions)
                                                : JumpError(library, plan, conditions);
}

double DirectionError(const DVec3& requested, const DVec3& path) {
  if (Horizontal(requested) < kShortestPathM || Horizontal(path) < kSamePlaceM) return 0.0;
  return std::fabs(Atan2(requested.z * path.x - requested.x * path.z,
                         requested.x * path.x + requested.z * path.z));
}

}  // namespace stridewire
