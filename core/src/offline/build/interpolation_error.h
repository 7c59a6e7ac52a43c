#pragma once

#include <cstdint>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// The error of synthesized movements, e(p) = |p - a(p)| (paper, Section 4), over the hull of the
/// examples of a group. a(p) are the measured parameters of the movement for p.
struct InterpolationError {
  double min_m = 0.0;
  double mean_m = 0.0;
  double max_m = 0.0;
  double corrected_mean_m = 0.0;
  /// Largest error after CorrectWeights, which avatars use at the start of each movement.
  double corrected_max_m = 0.0;
  /// Largest error after at most three iterations of CorrectWeights.
  double corrected_in_3_max_m = 0.0;
  double corrected_weight_sum_max = 0.0;  ///< Largest sum of |w| after correction.
  double weight_sum_max = 0.0;            ///< Largest sum of |w| without correction.
  int samples = 0;                        ///< Number of samples over which the means are computed.
  int iterations = 0;                     ///< Limit on the iterations of a correction.
};

/// Measures the error at the examples, at random convex combinations (see SampleHull), and at the
/// peaks found by steepest ascent from the worst of these. Uses all processors; the result does not
/// depend on their number.
[[nodiscard]] InterpolationError MeasureInterpolationError(const MotionLibrary& library,
                                                           int group_index, int samples = 1000,
                                                           std::uint32_t seed = 1);

}  // namespace stridewire
