#pragma once

#include <algorithm>

namespace stridewire {

/// Returns 0 for x <= 0, 1 for x >= 1, and 3x^2 - 2x^3 between them. The slope is 0 at both ends.
[[nodiscard]] inline double SmoothStep(double x) {
  const double s = std::clamp(x, 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}

/// Returns 0 for x <= 0, 1 for x >= 1, and 6x^5 - 15x^4 + 10x^3 between them. Slope and curvature
/// are 0 at both ends.
[[nodiscard]] inline double SmootherStep(double x) {
  const double s = std::clamp(x, 0.0, 1.0);
  return s * s * s * (10.0 + s * (6.0 * s - 15.0));
}

/// Returns 16 x^2 (1 - x)^2 for x in [0, 1] and 0 elsewhere: a bump of height 1 at x = 0.5, with
/// slope 0 at both ends.
[[nodiscard]] inline double Bump(double x) {
  const double s = std::clamp(x, 0.0, 1.0);
  return 16.0 * s * s * (1.0 - s) * (1.0 - s);
}

}  // namespace stridewire
