#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Which of a movement's keytimes feet leave the ground and land at.
struct ContactKeytimes {
  std::size_t toe_off = 0;
  std::size_t landing = 0;
};

/// Steps: the moving foot leaves at the first keytime inside and lands at the last. Jumps of five
/// intervals have the body's lowest points outside of both.
[[nodiscard]] inline ContactKeytimes ContactKeytimesOf(MovementKind kind, int interval_count) {
  if (kind == MovementKind::kJump && interval_count == 5) return {2, 3};
  return {1, static_cast<std::size_t>(std::max(interval_count - 1, 0))};
}

/// How much higher the ground is where a foot lands that the parameters put `height_m` above the other.
/// They are measured at the balls, which differ by some centimetres on level ground at the middle of
/// double support, since feet roll; taken for ground, that climbs half a metre in a hundred level steps.
[[nodiscard]] inline double GroundRise(double height_m) {
  constexpr double kLevelM = 0.05;
  return std::fabs(height_m) > kLevelM ? height_m : 0.0;
}

}  // namespace stridewire
