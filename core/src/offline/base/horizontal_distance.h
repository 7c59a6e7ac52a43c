#pragma once

#include <cmath>

#include "stridewire/base/math.h"

namespace stridewire {

// Returns the distance between two points, ignoring their heights.
[[nodiscard]] inline double HorizontalDistance(const DVec3& a, const DVec3& b) {
  return std::hypot(a.x - b.x, a.z - b.z);
}

}  // namespace stridewire
