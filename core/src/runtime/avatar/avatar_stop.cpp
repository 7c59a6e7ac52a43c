// AvatarSimulation: steps that bring the feet together before a stand.

#include <cmath>

#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/locomotion_profile.h"

namespace stridewire {
namespace {

// A closing step after another inserted step must bring the feet closer together by at least this
// distance.
constexpr double kClosingGainM = 0.03;
// If the forward distance between the feet at the end of a step differs from that of the stand pose
// by at most this distance, the step needs no correction by planting.
constexpr double kClosedM = 0.03;
// An avatar brings its feet together only if their heights then differ by at most this distance, or
// by no more than they do now. It does not do so if one foot stands on a high, small stone, for
// example.
constexpr double kMaxStandClimbM = 0.15;

// Returns the forward distance between the feet at the end of a planned step.
double EndLength(const MotionLibrary& library, const RequestPlan& plan) {
  const int end_z = library.group(plan.group).FindParameter(ParameterName::kEndZ);
  return end_z < 0 ? 0.0 : plan.applied.values[static_cast<std::size_t>(end_z)];
}

}  // namespace

// Plans a step that brings the feet together, or the first of two such steps. Returns nullopt if
// the library has none or the ground does not permit it.
std::optional<RequestPlan> AvatarSimulation::PlanClosingStep() const {
  const MotionLibrary& library = *body_.library;
  const bool is_planted = body_.plants_feet;
  const double largest_miss_m = is_planted ? kMaxPlantedErrorM : kFeetApartForwardM;
  const auto closing = [&](const FootState& feet, Foot last_moved) {
    const double length_m = stand_feet_.Vector(OtherFoot(last_moved)).z;
    return PlanStep(library, StepRequest{.length_m = length_m}, feet, last_moved, false);
  };
  const auto foot_of = [&](const RequestPlan& plan) {
    return MovingFoot(library.group(plan.group).kind);
  };
  const auto miss_of = [&](const RequestPlan& plan) {
    return std::fabs(EndLength(library, plan) - stand_feet_.Vector(foot_of(plan)).z);
  };

  const auto plan = closing(feet_, last_moved_);
  if (!plan) return std::nullopt;
  const Foot foot = foot_of(*plan);
  if (!HasGroundBeside(OtherFoot(foot))) return std::nullopt;
  const double miss_m = miss_of(*plan);
  if (miss_m <= (is_planted ? kClosedM : kFeetApartForwardM)) {
    const double apart_m = std::fabs(feet_.Vector(foot).z - stand_feet_.Vector(foot).z);
    const bool is_better = inserted_steps_ == 0 || miss_m < apart_m - kClosingGainM;
    return is_better ? plan : std::nullopt;
  }
  if (miss_m <= largest_miss_m) return PlanPlantedClosingStep(foot);
  if (inserted_steps_ + 1 >= kMaxInsertedSteps) return std::nullopt;
  const DVec3 after(stand_feet_.Vector(foot).x, 0.0, EndLength(library, *plan));
  const auto second = closing({foot == Foot::kLeft ? after : -after}, foot);
  return second && miss_of(*second) <= largest_miss_m ? plan : std::nullopt;
}

// Returns the place beside the foot `fixed` where the other foot must land to bring the feet
// together.
DVec3 AvatarSimulation::PlaceBeside(Foot fixed) const {
  const DVec3 vector = stand_feet_.Vector(OtherFoot(fixed));
  return StandingPosition(fixed) + RotateYaw(base_.heading_rad, DVec3(vector.x, 0.0, vector.z));
}

// Returns true if the height of the ground beside a standing foot is suitable for the other foot.
bool AvatarSimulation::HasGroundBeside(Foot fixed) const {
  if (options_.terrain == nullptr || !body_.plants_feet) return true;
  const double fixed_m = StandingPosition(fixed).y;
  const DVec3 beside = PlaceBeside(fixed);
  const double climb_m = std::fabs(options_.terrain->HeightAt(beside.x, beside.z) - fixed_m);
  return climb_m <= kMaxStandClimbM ||
         climb_m <= std::fabs(StandingPosition(OtherFoot(fixed)).y - fixed_m);
}

// Plans a step that brings `foot` beside the other foot. Planting moves the foot there, even if the
// steps of the library end elsewhere.
std::optional<RequestPlan> AvatarSimulation::PlanPlantedClosingStep(Foot foot) const {
  if (!HasGroundBeside(OtherFoot(foot))) return std::nullopt;
  const DVec3 fixed_m = StandingPosition(OtherFoot(foot));
  const DVec3 beside_m = PlaceBeside(OtherFoot(foot));
  auto plan = PlanRequest(
      {.movement = StepRequest{.foot = foot, .at = FootprintRequest{beside_m, base_.heading_rad}}});
  if (!plan) return plan;
  plan->most_residual_m = kMaxPlantedErrorM;
  const auto fixed = static_cast<std::size_t>(OtherFoot(foot));
  plan->root_m = fixed_m - RotateYaw(base_.heading_rad,
                                     body_.library->locomotion_profile().stand_feet_m[fixed]);
  return plan;
}

// Returns why the feet are apart while the avatar stands, or an empty string if they are together.
const char* AvatarSimulation::WhyFeetAreApart() const {
  if (!AreFeetApart(feet_, stand_feet_)) return "";
  return HasGroundBeside(last_moved_)
             ? "the library has no step that brings the feet together from here"
             : "the ground beside the foot is too high or too low for the other foot";
}

}  // namespace stridewire
