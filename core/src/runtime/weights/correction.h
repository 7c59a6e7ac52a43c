#pragma once

#include <span>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// When a correction stops.
struct CorrectionLimits {
  int max_iterations = 3;
  double tolerance_m = 1e-5;  ///< Stop when the error is at most this.
};

/// The limits for starting a movement: 3 iterations for groups with one or two parameters (straight
/// steps, jumps) and 8 iterations for others.
[[nodiscard]] CorrectionLimits DefaultCorrectionLimits(const MotionGroup& group);

/// Limit on the sum of |w| after correction. If the sum is already larger without correction, that
/// sum is the limit.
inline constexpr double kMaxCorrectedWeightSum = 2.5;

/// Result of a correction.
struct Correction {
  double error_m = 0.0;          ///< |p^ - a| as in LargestDifference; <= initial_error_m
  double initial_error_m = 0.0;  ///< e(p^) = |p^ - a(p^)|: the error without correction
  int iterations = 0;
};

/// Sets the group, parameters and weights of a movement so that the movement really has the
/// parameters p^ given by `wanted` (paper, Section 4; the paper searches for p* with a(p*) = p^
/// instead). Performs Gauss-Newton iterations on the weights:
///
///   w <- w + D J^T y,   [J; 1] D [J; 1]^T y = [p^ - a(w); 0],   J = a'(w) [d][n],
///   D = diag(|w| + half of its mean)
///
/// Of all changes that correct the parameters to first order, this is the smallest relative to how
/// much each example is used. a(w) and J depend only on the first and the last pose.
///
/// If the sum of |w| would come within 0.1 of its limit, the part of w that does not affect the
/// parameters shrinks as far as necessary. A step that increases the error or makes the weights too
/// large is halved up to three times. The best w is kept, so the result is never worse than without
/// correction. An error remains if no weights within the limit reach p^.
///
/// `weight_scratch`, of size n or more, receives the weights in double precision. Uses 500 KB of
/// stack, of which 72 bytes per example and 0.4 KB per joint of the legs are touched. Does not
/// allocate if `movement.weights` has room for the group. Same bytes on every machine.
Correction CorrectWeights(const MotionLibrary& library, int group_index,
                          const ParameterValues& wanted, const CorrectionLimits& limits,
                          std::span<double> weight_scratch, Movement& movement);

/// The same for a group that is not part of a library yet. Sets movement.group to -1.
Correction CorrectWeights(const Skeleton& skeleton, const GridLayout& layout,
                          const MotionGroup& group, const ParameterValues& wanted,
                          const CorrectionLimits& limits, std::span<double> weight_scratch,
                          Movement& movement);

}  // namespace stridewire
