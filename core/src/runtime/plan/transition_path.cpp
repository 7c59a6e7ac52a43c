#include "runtime/plan/transition_path.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/skeleton/foot_vector.h"

namespace stridewire {
namespace {

// The feet are apart if the sideways distance between them differs from that of the stand pose by
// more than this.
constexpr double kFeetApartAsideM = 0.3;

// Planting can distribute an error up to this size over a swing (RequestPlan::most_residual_m).
constexpr double kMaxStartErrorM = 0.25;
// An inserted step must reduce the cost of the request (CostM) by at least kMinStepGainM if a step
// is requested, and by kMinClosingGainM or to 0 if a jump is requested.
constexpr double kMinStepGainM = 0.25;
constexpr double kMinClosingGainM = 0.03;

class TransitionPathFinder {
 public:
  TransitionPathFinder(const MotionLibrary& library, const MovementRequest& request)
      : library_(library),
        stand_{FootVector(library.skeleton(), library.stand_pose(), Foot::kLeft, 0.0)},
        step_(std::get_if<StepRequest>(&request.movement)),
        jump_(std::get_if<JumpRequest>(&request.movement)),
        allows_nearest_(AllowsNearest(request)) {}

  [[nodiscard]] TransitionPath Find(const std::optional<RequestPlan>& direct,
                                    const Stance& stance) const {
    STRIDEWIRE_CHECK(stance.group <= library_.groups().size());
    STRIDEWIRE_CHECK(stance.inserted_steps >= 0 && stance.inserted_steps <= kMaxInsertedSteps);
    if (step_ != nullptr && step_->at) return {direct};
    const bool can_start = direct && CanStart(*direct, stance);
    const TransitionPath without_insertion{can_start ? direct : std::nullopt};
    if (can_start && !StartsWithFeetApart(*direct, stance)) return without_insertion;
    if (const auto other = FindOtherGroup(direct, stance)) return {other};
    // If the request can begin now, one inserted step may improve it. Otherwise, the search inserts
    // the number of steps that the request needs.
    const double max_cost_m = can_start && IsInReach(*direct, stance)
                                  ? MaxCostAfterStepM(CostM(*direct, stance))
                                  : HUGE_VAL;
    const int max_steps =
        std::min(can_start ? 1 : kMaxInsertedSteps, kMaxInsertedSteps - stance.inserted_steps);
    for (int steps = 1; steps <= max_steps; ++steps) {
      if (auto first = FindFirstStep(steps, stance, max_cost_m)) return {first, true};
    }
    return without_insertion;
  }

 private:
  // If the group of the requested step may not follow the previous movement, returns the best plan
  // in a group that may. Captured and generated strides, for example, can be too different.
  std::optional<RequestPlan> FindOtherGroup(const std::optional<RequestPlan>& direct,
                                            const Stance& stance) const {
    if (step_ == nullptr || !direct ||
        MayFollow(library_, stance.group, static_cast<std::size_t>(direct->group))) {
      return std::nullopt;
    }
    StepRequest step = *step_;
    step.foot = MovingFoot(library_.group(direct->group).kind);
    auto other = PlanStep(library_, step, stance.feet, stance.last_moved, false, stance.group);
    if (!other || StartsWithFeetApart(*other, stance) || !IsInReach(*other, stance)) {
      return std::nullopt;
    }
    return other;
  }

  // Finds the first of exactly `steps` inserted steps after which the request is possible and costs
  // at most `max_cost_m`.
  std::optional<RequestPlan> FindFirstStep(int steps, const Stance& stance,
                                           double max_cost_m) const {
    for (const Foot foot : {OtherFoot(stance.last_moved), stance.last_moved}) {
      auto step =
          PlanStep(library_, StepRequest{.foot = foot}, stance.feet, stance.last_moved, false);
      if (!step || !CanStart(*step, stance)) continue;
      const Stance after = After(stance, *step, foot);
      if (steps > 1 ? FindFirstStep(steps - 1, after, max_cost_m).has_value()
                    : IsPossibleAfter(after, max_cost_m)) {
        return step;
      }
    }
    return std::nullopt;
  }

  bool IsPossibleAfter(const Stance& stance, double max_cost_m) const {
    const auto plan = jump_ != nullptr
                          ? PlanJump(library_, *jump_)
                          : PlanStep(library_, *step_, stance.feet, stance.last_moved, false);
    return plan && CanStart(*plan, stance) && CostM(*plan, stance) <= max_cost_m &&
           IsInReach(*plan, stance);
  }

  Stance After(const Stance& stance, const RequestPlan& step, Foot foot) const {
    const MotionGroup& group = library_.group(step.group);
    const auto end_or = [&](ParameterName name, double fallback) {
      const int l = group.FindParameter(name);
      return l < 0 ? fallback : step.applied.values[static_cast<std::size_t>(l)];
    };
    const DVec3 vector(end_or(ParameterName::kEndX, stand_.Vector(foot).x),
                       end_or(ParameterName::kEndY, 0.0), end_or(ParameterName::kEndZ, 0.0));
    Stance after = stance;
    after.feet = {foot == Foot::kLeft ? vector : -vector};
    after.last_moved = foot;
    after.group = static_cast<std::size_t>(step.group);
    return after;
  }

  bool IsInReach(const RequestPlan& plan, const Stance& stance) const {
    return allows_nearest_ || !ErrorOf(library_, plan, stance.feet, stance.conditions).IsTooLarge();
  }

  bool CanStart(const RequestPlan& plan, const Stance& stance) const {
    return MayFollow(library_, stance.group, static_cast<std::size_t>(plan.group)) &&
           (!StartsWithFeetApart(plan, stance) || StartErrorM(plan, stance) <= kMaxStartErrorM);
  }

  // Returns true if the feet are apart and the movement is a jump or a step of the foot that moved
  // last. In this case, the other foot should step first.
  bool StartsWithFeetApart(const RequestPlan& plan, const Stance& stance) const {
    const MovementKind kind = library_.group(plan.group).kind;
    return AreFeetApart(stance.feet, stand_) &&
           (!IsStep(kind) || MovingFoot(kind) == stance.last_moved);
  }

  // Returns by how much the forward distance between the feet differs from that at the start of the
  // planned movement.
  double StartErrorM(const RequestPlan& plan, const Stance& stance) const {
    const MotionGroup& group = library_.group(plan.group);
    const int l = group.FindParameter(ParameterName::kStartZ);
    if (l < 0) return std::fabs(stance.feet.left_from_right_m.z - stand_.left_from_right_m.z);
    return std::fabs(stance.feet.Vector(MovingFoot(group.kind)).z -
                     plan.applied.values[static_cast<std::size_t>(l)]);
  }

  // Returns the cost of a request in metres. For a jump, this is the distance by which the feet
  // exceed the limits of AreFeetApart.
  double CostM(const RequestPlan& plan, const Stance& stance) const {
    if (jump_ == nullptr) return plan.cost_m;
    const DVec3 apart = stance.feet.left_from_right_m - stand_.left_from_right_m;
    return std::max(
        {0.0, std::fabs(apart.z) - kFeetApartForwardM, std::fabs(apart.x) - kFeetApartAsideM});
  }

  // Returns the maximum cost after an inserted step at which inserting the step is worthwhile.
  double MaxCostAfterStepM(double cost_m) const {
    return jump_ != nullptr ? std::max(0.0, cost_m - kMinClosingGainM) : cost_m - kMinStepGainM;
  }

  const MotionLibrary& library_;
  FootState stand_;
  const StepRequest* step_;
  const JumpRequest* jump_;
  bool allows_nearest_;
};

}  // namespace

bool AllowsNearest(const MovementRequest& request) {
  const auto* step = std::get_if<StepRequest>(&request.movement);
  const auto* jump = std::get_if<JumpRequest>(&request.movement);
  return step != nullptr ? step->allow_nearest : jump != nullptr && jump->allow_nearest;
}

bool AreFeetApart(const FootState& feet, const FootState& stand) {
  const DVec3 apart = feet.left_from_right_m - stand.left_from_right_m;
  return std::fabs(apart.z) > kFeetApartForwardM || std::fabs(apart.x) > kFeetApartAsideM;
}

TransitionPath FindTransitionPath(const MotionLibrary& library, const MovementRequest& request,
                                  const std::optional<RequestPlan>& direct, const Stance& stance) {
  return TransitionPathFinder(library, request).Find(direct, stance);
}

const char* NoPathReason(MovementKind from, MovementKind to) {
  static constexpr std::array<std::array<const char*, 3>, 4> kReasons{
      {{"this library has no transition path from step_left to step_left",
        "this library has no transition path from step_left to step_right",
        "this library has no transition path from step_left to jump"},
       {"this library has no transition path from step_right to step_left",
        "this library has no transition path from step_right to step_right",
        "this library has no transition path from step_right to jump"},
       {"this library has no transition path from jump to step_left",
        "this library has no transition path from jump to step_right",
        "this library has no transition path from jump to jump"},
       {"this library has no transition path from a stand to step_left",
        "this library has no transition path from a stand to step_right",
        "this library has no transition path from a stand to jump"}}};
  return kReasons.at(static_cast<std::size_t>(from)).at(static_cast<std::size_t>(to));
}

}  // namespace stridewire
