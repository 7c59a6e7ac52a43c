#pragma once

#include "runtime/plan/foot_planner.h"

namespace stridewire {

/// Sets FootPlan::root_approach of a planned movement. Its duration is chosen so that the blend
/// from the previous pose does not accelerate the pelvis too much, up to a maximum duration. Does
/// nothing for stands. Call it after setting the residuals of the plan.
void PlanRootApproach(const FootPlanJob& job);

}  // namespace stridewire
