#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

// Returns the scales by which distances between parameters are measured, in the order of
// parameters.
[[nodiscard]] inline std::vector<double> ScalesOf(const MotionGroup& group) {
  std::vector<double> scales;
  for (const Parameter& parameter : group.parameters) scales.push_back(parameter.scale);
  return scales;
}

// Returns the scaled distance of two points. `a` and `b` may have more than d values.
[[nodiscard]] inline double ScaledDistance(const MotionGroup& group, std::span<const double> a,
                                           std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    const double difference = (a[l] - b[l]) / group.parameters[l].scale;
    sum += difference * difference;
  }
  return std::sqrt(sum);
}

}  // namespace stridewire
