#pragma once

#include "runtime/plan/foot_planner.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// Raises the moving foot of a planned step so that its sole clears the ground between its
/// footprints (ChooseSwing).
void ClearGround(const FootPlanJob& job, Foot moving, const Terrain& terrain);

/// Returns by how much a planned step must lower the root until its end, so that both legs reach
/// their footprints. The root then descends gradually (RootSinkShare). Otherwise, planting would
/// lower it abruptly just before the foot lands on a lower tread.
[[nodiscard]] double RootSink(const FootPlanJob& job, Foot moving);

}  // namespace stridewire
