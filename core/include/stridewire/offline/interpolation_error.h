#pragma once

#include <cstdint>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// How far synthesized movements miss what was asked: e(p) = |p - a(p)| (paper, Section 4).
struct InterpolationError {
  double max_m = 0.0;
  double mean_m = 0.0;
  double corrected_max_m = 0.0;  ///< After CorrectParameters, as when a movement starts.
  double corrected_mean_m = 0.0;
  int samples = 0;
  int iterations = 0;  ///< The most a correction takes.
};

/// Samples the hull of a group's examples by seeded convex combinations (Dirichlet weighted, so that
/// faces and corners are met too) plus the examples themselves.
[[nodiscard]] InterpolationError MeasureInterpolationError(const MotionLibrary& library,
                                                           int group_index, int samples = 1000,
                                                           std::uint32_t seed = 1);

}  // namespace stridewire
