#pragma once

#include <cmath>
#include <cstddef>

#include "stridewire/base/math.h"
#include "stridewire/offline/bvh_reader.h"

namespace stridewire {

inline std::size_t Index(int i) { return static_cast<std::size_t>(i); }

[[nodiscard]] inline DVec3 AxisVector(BvhAxis axis) {
  DVec3 v(0.0);
  const int i = static_cast<int>(axis);
  v[i / 2] = i % 2 == 0 ? 1.0 : -1.0;
  return v;
}

/// Returns the axis of the file that is nearest to `v`.
[[nodiscard]] inline BvhAxis NearestAxis(const DVec3& v) {
  int largest = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::fabs(v[i]) > std::fabs(v[largest])) largest = i;
  }
  return static_cast<BvhAxis>(2 * largest + (v[largest] < 0.0 ? 1 : 0));
}

/// Returns the name of an axis, for example "+y".
[[nodiscard]] inline const char* AxisName(BvhAxis axis) {
  static constexpr const char* kNames[] = {"+x", "-x", "+y", "-y", "+z", "-z"};
  return kNames[static_cast<int>(axis)];
}

}  // namespace stridewire
