#pragma once

#include <cstdint>

namespace stridewire {

/// How one movement goes on where another ended: of the first group the example that ends and of the second
/// the one that starts most alike.
struct Transition {
  /// Root mean square over the joints of how far they are apart, both poses brought to the same place, ground
  /// and heading, and kTransitionVelocityS times the same of their velocities. Metres.
  float distance_m = 0.0f;
  std::int32_t end_example = -1;    ///< -1: the stand
  std::int32_t start_example = -1;  ///< -1: the stand
};

/// A velocity is as bad as the way it leads in that time: half of what a difference is eased out over.
inline constexpr double kTransitionVelocityS = 0.1;

}  // namespace stridewire
