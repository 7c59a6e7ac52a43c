#pragma once

#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// What is measured of a movement's first and last pose.
struct EndMeasures {
  DVec3
      start_m;  ///< From the foot that stands to the one that moves, in the heading frame of the start
  DVec3 end_m;     ///< The same of the end
  DVec3 travel_m;  ///< How far the centre between the balls goes, in the heading frame of the start
  double heading_change_rad;
};

/// The parameters of a group that these are.
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
