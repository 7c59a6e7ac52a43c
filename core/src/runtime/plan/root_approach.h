#pragma once

#include "runtime/plan/foot_planner.h"

namespace stridewire {

/// Sets FootPlan::root_approach of a planned movement. It limits the acceleration of the pelvis
/// while the difference pose and the residual of the root fade out, if they have enough time. Does
/// nothing for stands. Call it after setting the residuals of the plan.
void PlanRootApproach(const FootPlanJob& job);

}  // namespace stridewire
