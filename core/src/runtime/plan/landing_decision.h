#pragma once

#include <array>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// The choices that PlanFeet makes with the request and the terrain. The rest of a plan can be
/// computed from these choices, so replicas need neither the request nor the terrain.
struct LandingDecision {
  double extra_turn_rad = 0.0;  ///< Movement::extra_turn_rad
  bool is_on_terrain = false;
  /// [foot]: landing positions of the feet that move.
  std::array<DVec3, 2> to_m{DVec3(0.0), DVec3(0.0)};
  // The following members are used for steps only.
  /// Turn of the foot at landing, in addition to that of the library's step.
  double turn_rad = 0.0;
  double height_m = 0.0;  ///< Correction of the height of the blended foot at landing.
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);   ///< Ground normal at landing, on terrain.
  std::array<double, 3> lift_m{};         ///< FootTrajectory::lift_m
  DVec3 mid_swing_offset_m = DVec3(0.0);  ///< FootTrajectory::mid_swing_offset_m
  DVec3 root_shift_m = DVec3(0.0);        ///< FootTrajectory::root_shift_m
};

/// Returns the decisions for a movement that has been planned.
[[nodiscard]] LandingDecision DecisionOf(MovementKind kind, const Movement& movement);

}  // namespace stridewire
