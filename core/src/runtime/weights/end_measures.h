#pragma once

#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Measurements of a movement's first and last pose. Feet are measured at their balls. In jumps,
/// the left foot counts as the moving foot.
struct EndMeasures {
  /// Vector from the fixed foot to the moving foot in the first pose, in the heading frame of that
  /// pose.
  DVec3 start_m = DVec3(0.0);
  /// Vector from the fixed foot to the moving foot in the last pose, in the heading frame of that
  /// pose.
  DVec3 end_m = DVec3(0.0);
  /// Displacement of the midpoint between the balls, in the heading frame of the first pose.
  DVec3 travel_m = DVec3(0.0);
  double heading_change_rad = 0.0;
};

/// Returns one parameter of a movement with these measurements.
[[nodiscard]] inline double ParameterOf(const EndMeasures& ends, ParameterName name) {
  switch (name) {
    case ParameterName::kStartX: return ends.start_m.x;
    case ParameterName::kStartY: return ends.start_m.y;
    case ParameterName::kStartZ: return ends.start_m.z;
    case ParameterName::kEndX: return ends.end_m.x;
    case ParameterName::kEndY: return ends.end_m.y;
    case ParameterName::kEndZ: return ends.end_m.z;
    case ParameterName::kTurn: return ends.heading_change_rad;
    case ParameterName::kLength: return ends.travel_m.z;
    case ParameterName::kHeight: return ends.travel_m.y;
  }
  return 0.0;
}

/// Converts the measurements to the parameters of a group.
[[nodiscard]] inline ParameterValues ParametersOf(const MotionGroup& group,
                                                  const EndMeasures& ends) {
  ParameterValues measured;
  measured.count = group.parameter_count();
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    measured.values[l] = ParameterOf(ends, group.parameters[l].name);
  }
  return measured;
}

}  // namespace stridewire
