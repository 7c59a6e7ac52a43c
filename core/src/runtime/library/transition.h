#pragma once

#include <cstdint>

namespace stridewire {

/// Measures how well movements of a second group can follow movements of a first group. The values
/// are those of the best pair of examples: one of the first group at its end, and one of the second
/// group at its start.
struct Transition {
  /// In metres: root mean square distance of the joints, plus kTransitionVelocityS times that of
  /// their velocities. The poses are first moved to the same position, ground height and heading.
  float distance_m = 0.0f;
  std::int32_t end_example = -1;    ///< Example of the first group; -1: the stand.
  std::int32_t start_example = -1;  ///< Example of the second group; -1: the stand.
};

/// The distance of two velocities is the distance that their difference covers in this time. It is
/// half of the time over which a difference pose fades out.
inline constexpr double kTransitionVelocityS = 0.1;

}  // namespace stridewire
