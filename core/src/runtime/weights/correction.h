#pragma once

#include <span>

#include "stridewire/runtime/motion_library.h"
#include "runtime/movement/movement.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// How far a correction goes.
struct CorrectionLimits {
  int max_iterations = 3;
  double tolerance_m = 1e-5;  ///< Good enough: 0.01 mm.
};

/// The limits movements are started with: 3 iterations with up to two parameters (straight steps,
/// jumps), 8 with more.
[[nodiscard]] CorrectionLimits DefaultCorrectionLimits(const MotionGroup& group);

/// Corrected weights keep the sum of |w| below this, or below what it is without correction.
inline constexpr double kMaxCorrectedWeightSum = 2.5;

/// What a correction came to.
struct Correction {
  double error_m = 0.0;          ///< |p^ - a|, as LargestDifference; <= initial_error_m
  double initial_error_m = 0.0;  ///< e(p^) = |p^ - a(p^)|: without correction
  int iterations = 0;
};

/// Sets the movement's group, parameters and weights so that it has the parameters p^, `wanted` (paper,
/// Section 4; there p* with a(p*) = p^ is sought). A round of Gauss and Newton's method on the weights:
///
///   w <- w + D J^T y,   [J; 1] D [J; 1]^T y = [p^ - a(w); 0],   J = a'(w) [d][n],
///   D = diag(|w| + half of its mean)
///
/// the change that is least in proportion to how much examples are used, of those right in all
/// parameters to first order. a(w) takes the first and last pose only, and so does J.
/// Where the sum of |w| would come within 0.1 of its bound, what J does not see of w shrinks as far as
/// that takes. A step that makes the error larger or the weights too large is halved, three times at
/// most; the best w is kept, so that the result is never worse than no correction. Some error is left
/// where nothing within the bound reaches p^.
///
/// `weight_scratch` [n] or more gets the weights, as they are before floats. Takes 500 KB of stack, touched by 72
/// bytes an example and 0.4 KB a joint of the legs; never allocates once
/// `movement.weights` has room for the group. Same bytes on every machine.
Correction CorrectWeights(const MotionLibrary& library, int group_index,
                          const ParameterValues& wanted, const CorrectionLimits& limits,
                          std::span<double> weight_scratch, Movement& movement);

/// The same in a group that is in no library yet.
Correction CorrectWeights(const Skeleton& skeleton, const GridLayout& layout,
                          const MotionGroup& group, const ParameterValues& wanted,
                          const CorrectionLimits& limits, std::span<double> weight_scratch,
                          Movement& movement);

}  // namespace stridewire
