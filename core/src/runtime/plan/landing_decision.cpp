#include "runtime/plan/landing_decision.h"

namespace stridewire {

LandingDecision DecisionOf(MovementKind kind, const Movement& movement) {
  const FootPlan& plan = movement.feet;
  LandingDecision decision{.extra_turn_rad = movement.extra_turn_rad,
                           .is_on_terrain = plan.keeps_above_ground,
                           .to_m = {plan.feet[0].to.position_m, plan.feet[1].to.position_m}};
  if (!IsStep(kind)) return decision;
  const FootTrajectory& trajectory = plan.foot(MovingFoot(kind));
  decision.turn_rad = trajectory.turn_rad[2];
  decision.height_m = trajectory.height_m[2];
  decision.normal = trajectory.normals[1];
  decision.lift_m = trajectory.lift_m;
  decision.mid_swing_offset_m = trajectory.mid_swing_offset_m;
  decision.root_shift_m = trajectory.root_shift_m;
  return decision;
}

}  // namespace stridewire
