#pragma once

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Times at which the moving feet of a movement leave the ground and come to rest, in seconds. They
/// are the same with and without planting.
struct SwingTimes {
  double release_s = 0.0;
  double land_s = 0.0;
};

/// Returns the swing times of a movement.
[[nodiscard]] SwingTimes SwingTimesOf(MovementKind kind, const Movement& movement);

/// Returns the time of a phase. Phase 0 is the start of the movement, 1 the release and 2 the
/// landing.
[[nodiscard]] double TimeAtPhase(const SwingTimes& swing, double phase);

}  // namespace stridewire
