#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Indices of the keytimes at which the feet of a movement leave the ground and land.
struct ContactKeytimes {
  std::size_t toe_off = 0;
  std::size_t landing = 0;
};

/// The moving foot of a step leaves the ground at the first inner keytime and lands at the last
/// inner one. The same holds for jumps, except that jumps of five intervals have two more inner
/// keytimes, one before take-off and one after landing, at which the body is lowest.
[[nodiscard]] inline ContactKeytimes ContactKeytimesOf(MovementKind kind, int interval_count) {
  if (kind == MovementKind::kJump && interval_count == 5) return {2, 3};
  return {1, static_cast<std::size_t>(std::max(interval_count - 1, 0))};
}

/// Returns the height of the ground at the landing foot relative to the ground at the other foot,
/// in metres, for a step whose height parameter is `height_m`. Parameters are measured at the balls
/// of the feet. On level ground, the heights of the balls differ by some centimetres, because feet
/// roll. Differences of up to 5 cm therefore count as level. Otherwise, they would add up over a
/// walk.
[[nodiscard]] inline double GroundRise(double height_m) {
  constexpr double kLevelM = 0.05;
  return std::fabs(height_m) > kLevelM ? height_m : 0.0;
}

}  // namespace stridewire
