#pragma once

#include <span>

#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement.h"
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

/// Corrected parameters keep the sum of |w| below this, or below what it is without correction.
inline constexpr double kMaxCorrectedWeightSum = 2.5;
/// Corrected parameters stay this close to the wanted ones, metres (a radian: kMetresPerRadian).
inline constexpr double kMaxCorrectionM = 0.25;

/// Parameters to take a group's weights at, so that the movement has those that are wanted.
struct Correction {
  ParameterValues parameters;    ///< p*
  double error_m = 0.0;          ///< |p^ - a(p*)|, as LargestDifference; <= initial_error_m
  double initial_error_m = 0.0;  ///< e(p^) = |p^ - a(p^)|: without correction
  int iterations = 0;
};

/// Finds p* with a(p*) = p^, where p^ is `wanted` (paper, Section 4; there while a library is refined,
/// here also when a movement starts, since a(p) takes its first and last pose only):
///
///   p <- p + B (p^ - a(p)),   B = I at first, since a(p) is nearly p
///
/// Where one round is not enough, B = a'(p)^-1 by differences, kept up by Broyden's rank-one update
/// (1965) once the error is small. A step that makes the error larger, or the weights too large, is
/// taken back and halved; the best p is kept, so that the result is never worse than no correction.
/// Some error is left where nothing within the bounds above reaches p^.
///
/// `weight_scratch` [max_example_count], `cache` and `pose` (one rotation a joint) are scratch, and so
/// is `movement`. Never allocates once `movement.weights` has room for the group. Same bytes on every
/// machine.
[[nodiscard]] Correction CorrectParameters(const MotionLibrary& library, int group_index,
                                           const ParameterValues& wanted,
                                           const CorrectionLimits& limits,
                                           std::span<double> weight_scratch, GridCache& cache,
                                           PoseSpan pose, Movement& movement);

/// The same in a group that is in no library yet.
[[nodiscard]] Correction CorrectParameters(const Skeleton& skeleton, const GridLayout& layout,
                                           const MotionGroup& group, const ParameterValues& wanted,
                                           const CorrectionLimits& limits,
                                           std::span<double> weight_scratch, GridCache& cache,
                                           PoseSpan pose, Movement& movement);

}  // namespace stridewire
