#pragma once

#include <vector>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

// By what distances between parameters of a group are measured, in the order of its parameters.
[[nodiscard]] inline std::vector<double> ScalesOf(const MotionGroup& group) {
  std::vector<double> scales;
  for (const Parameter& parameter : group.parameters) scales.push_back(parameter.scale);
  return scales;
}

}  // namespace stridewire
