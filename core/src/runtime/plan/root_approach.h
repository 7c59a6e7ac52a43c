#pragma once

#include "runtime/plan/foot_planner.h"

namespace stridewire {

/// Sets FootPlan::root_approach of a planned movement, so that the difference pose and the residual
/// of the root accelerate the pelvis no more than people do. Does nothing for stands, which blend
/// slowly anyway. Call this when the residuals of the plan are set.
void PlanRootApproach(const FootPlanJob& job);

}  // namespace stridewire
