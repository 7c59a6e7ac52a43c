#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

// Returns the scales for distances between parameters, in the order of the parameters.
[[nodiscard]] inline std::vector<double> ScalesOf(const MotionGroup& group) {
  std::vector<double> scales;
  for (const Parameter& parameter : group.parameters) scales.push_back(parameter.scale);
  return scales;
}

// Returns the inverse scales, which ProjectOntoHull uses as its metric.
[[nodiscard]] inline std::vector<double> MetricOf(const MotionGroup& group) {
  std::vector<double> metric;
  for (const Parameter& parameter : group.parameters) metric.push_back(1.0 / parameter.scale);
  return metric;
}

// Converts a point of the parameter space to ParameterValues.
[[nodiscard]] inline ParameterValues ValuesOf(std::span<const double> point) {
  ParameterValues values{.count = static_cast<int>(point.size())};
  std::copy(point.begin(), point.end(), values.values.begin());
  return values;
}

// Returns the scaled distance between two points. Ignores values beyond the group's parameters.
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
