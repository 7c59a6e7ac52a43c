#pragma once

#include <cstdint>

namespace stridewire {

/// How well a movement of one group continues after one of another: for the best pair of an example
/// that ends and an example that starts.
struct Transition {
  /// In metres: root mean square distance of the joints, plus kTransitionVelocityS times that of
  /// their velocities. The poses are first moved to the same position, ground height and heading.
  float distance_m = 0.0f;
  std::int32_t end_example = -1;    ///< -1: the stand.
  std::int32_t start_example = -1;  ///< -1: the stand.
};

/// A difference in velocity counts like the distance it covers in this time, which is half of the
/// time over which a difference pose fades out.
inline constexpr double kTransitionVelocityS = 0.1;

}  // namespace stridewire
