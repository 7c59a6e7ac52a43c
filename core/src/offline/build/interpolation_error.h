#pragma once

#include <cstdint>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// How far synthesized movements miss what was asked: e(p) = |p - a(p)| (paper, Section 4), over the
/// hull of a group's examples.
struct InterpolationError {
  double min_m = 0.0;
  double mean_m = 0.0;
  double max_m = 0.0;
  double corrected_mean_m = 0.0;
  double corrected_max_m = 0.0;           ///< After CorrectWeights, as when a movement starts.
  double corrected_in_3_max_m = 0.0;      ///< The same after three rounds at most
  double corrected_weight_sum_max = 0.0;  ///< Of |w|, corrected
  double weight_sum_max = 0.0;            ///< Of |w|, uncorrected
  int samples = 0;                        ///< What the means are over.
  int iterations = 0;                     ///< The most a correction takes.
};

/// Samples the hull by seeded convex combinations (Dirichlet weighted, so that faces and corners are
/// met too) plus the examples themselves, and climbs from the worst samples to the largest errors. Uses
/// all processors; the result is the same with any number of them.
[[nodiscard]] InterpolationError MeasureInterpolationError(const MotionLibrary& library,
                                                           int group_index, int samples = 1000,
                                                           std::uint32_t seed = 1);

}  // namespace stridewire
