#pragma once

#include "runtime/plan/foot_planner.h"

namespace stridewire {

/// Sets FootPlan::root_dip of a step on terrain. Its depth and speed are those with which planting
/// lowers the root when the moving foot is released. There is no dip if the depth is at most 1.5
/// cm, if the release is at most 1/60 s after the start, or if the movement is not a step. All
/// other parts of the plan must be complete, except the plant fade and FootPlan::packed.
/// Overwrites `job.pose`.
void PlanRootDip(const FootPlanJob& job);

}  // namespace stridewire
