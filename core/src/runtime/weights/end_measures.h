#pragma once

#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Measurements of a movement's first and last pose. Feet are measured at their balls.
struct EndMeasures {
  /// Vector from the fixed foot to the moving foot in the first pose, in its heading frame.
  DVec3 start_m;
  /// Vector from the fixed foot to the moving foot in the last pose, in its heading frame.
  DVec3 end_m;
  /// Displacement of the centre between the balls, in the heading frame of the first pose.
  DVec3 travel_m;
  double heading_change_rad;
};

/// Converts the measurements to the parameters of a group.
[[nodiscard]] inline ParameterValues ParametersOf(const MotionGroup& group,
                                                  const EndMeasures& ends) {
  ParameterValues measured;
  measured.count = group.parameter_count();
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    double& value = measured.values[l];
    switch (group.parameters[l].name) {
      case ParameterName::kStartX: value = ends.start_m.x; break;
      case ParameterName::kStartY: value = ends.start_m.y; break;
      case ParameterName::kStartZ: value = ends.start_m.z; break;
      case ParameterName::kEndX: value = ends.end_m.x; break;
      case ParameterName::kEndY: value = ends.end_m.y; break;
      case ParameterName::kEndZ: value = ends.end_m.z; break;
      case ParameterName::kTurn: value = ends.heading_change_rad; break;
      case ParameterName::kLength: value = ends.travel_m.z; break;
      case ParameterName::kHeight: value = ends.travel_m.y; break;
    }
  }
  return measured;
}

}  // namespace stridewire
