#pragma once

#include "runtime/plan/foot_planner.h"

namespace stridewire {

/// Sets FootPlan::root_dip of a planned step on terrain, from the amount and speed by which
/// planting lowers the root when the moving foot is released. Other movements have no dip. All
/// other parts of the plan must be complete, except FootPlan::packed.
void PlanRootDip(const FootPlanJob& job);

}  // namespace stridewire
