#pragma once

#include "runtime/plan/foot_planner.h"

namespace stridewire {

/// Sets FootPlan::root_approach of a planned movement, so that the difference pose and the residual
/// of the root do not accelerate the pelvis more than in captures of people. Does nothing for
/// stands, because they blend slowly anyway. Call it after setting the residuals of the plan.
void PlanRootApproach(const FootPlanJob& job);

}  // namespace stridewire
