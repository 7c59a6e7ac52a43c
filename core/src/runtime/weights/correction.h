#pragma once

#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "runtime/movement/movement.h"
#include "runtime/movement/stride_variation.h"
#include "runtime/weights/end_poses.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Limit on the sum of |w| after correction. If the sum is already larger without correction, that
/// sum is the limit.
inline constexpr double kMaxCorrectedWeightSum = 2.5;

/// Conditions under which the iterations of a correction stop, and limits on the weights w.
struct CorrectionLimits {
  int max_iterations = 3;
  double tolerance_m = 1e-5;  ///< Iterations stop when the error is at most this.
  /// Before the correction, negative weights are scaled down until the sum of |w| is at most this.
  double start_weight_sum = HUGE_VAL;
  double weight_sum = kMaxCorrectedWeightSum;  ///< Limit on the sum of |w| after correction.
};

/// Limits on the sum of |w| for climbing steps with few captured examples (decision 0048).
inline constexpr double kSparseStartWeightSum = 1.1;
inline constexpr double kSparseWeightSum = 1.4;

/// Returns the limits for starting a movement: 3 iterations for groups with one or two parameters
/// (straight steps, jumps) and 8 iterations for others.
///
/// The limits on weights are smaller for captured groups of steps with height parameters, if the
/// group has fewer than four examples per coefficient of the linear part of the weights (d + 1).
/// Otherwise, requests near the border of the hull would amplify the individual variation of the
/// examples, and knees and pelvis would jolt. If the movement then misses its parameters, planting
/// still puts the feet on their footprints.
[[nodiscard]] CorrectionLimits DefaultCorrectionLimits(const MotionGroup& group);

/// Result of a correction.
struct Correction {
  /// Error after correction: largest difference between requested and measured parameters, as in
  /// LargestDifference; <= initial_error_m.
  double error_m = 0.0;
  double initial_error_m = 0.0;  ///< The same error without correction.
  int iterations = 0;
};

/// Memory for CorrectWeights. It is allocated once and serves all corrections. Use one per thread.
class CorrectionScratch {
 public:
  /// Allocates memory for groups of up to `max_row_count` rows. Borrows `skeleton`.
  CorrectionScratch(const Skeleton& skeleton, const GridLayout& layout, int max_row_count);
  /// Allocates memory for all groups of a library, which must outlive the scratch.
  explicit CorrectionScratch(const MotionLibrary& library);

  /// Returns memory for the weights of a group in double precision. CorrectWeights writes its
  /// result there.
  [[nodiscard]] std::span<double> weights(const MotionGroup& group) {
    return std::span(weights_).first(static_cast<std::size_t>(group.example_count));
  }

 private:
  friend Correction CorrectWeights(const MotionGroup& group, const ParameterValues& wanted,
                                   const CorrectionLimits& limits, CorrectionScratch& scratch,
                                   Movement& movement,
                                   const std::optional<StrideVariation>& variation);

  EndPoses ends_;
  std::vector<double> weights_;  // [example]
  std::vector<double> next_;     // [example]
  std::vector<double> halved_;   // [example]
  std::vector<double> slopes_;   // [parameter, or row of KeepInVariation][example]
};

/// Sets the parameters and weights of a movement so that its measured parameters are p^, given by
/// `wanted` (paper, Section 4; the paper searches for p* with a(p*) = p^ instead). Performs
/// Gauss-Newton iterations on the weights:
///
///   w <- w + D [J; 1]^T y,   [J; 1] D [J; 1]^T y = [p^ - a(w); 0],   J = a'(w) [d][n],
///   D = diag(|w| + half of its mean)
///
/// Of all changes that correct the parameters to first order, this is the smallest one relative to
/// the weights of the examples. a(w) and J depend only on the first and the last pose.
///
/// If the sum of |w| exceeds `limits.start_weight_sum`, negative weights are scaled down first. If
/// the sum of |w| would come within 0.1 of its limit, the part of w that does not affect the
/// parameters shrinks. If an iteration increases the error or makes the weights too large, its
/// change is halved up to three times. The best w is kept, so the result is never worse than
/// without correction. An error remains if no weights within the limit reach p^, or if the
/// iterations do not suffice.
///
/// With `variation`, the weights of some steps are changed before the correction: those of groups
/// with one or two parameters, and of level steps of other groups that turn by at most 0.1 rad, if
/// the group has a parameter for the sideways position of the foot that lands.
///
/// - If the group has variants, the difference between one of them (see ChooseVariant) and the
///   blend for its parameters is added, scaled so that the pose changes by at most a fixed amount.
///   The sum of |w| of the examples may then exceed its limit.
/// - In other groups, the weights deviate at random. The part of the deviation that changes the
///   parameters is removed to first order, with D as above. In generated steps that start or stop
///   a walk, the part that changes the keytimes is removed as well. The rest is scaled to a fixed
///   change of the pose, or less if the limits on the weights and on their change require it.
///
/// If the correction then leaves an error above 0.1 mm, it is repeated without variation.
///
/// Sets movement.group to -1. If the group is part of a library, the caller must set the index
/// afterwards. Does not allocate if `movement.weights` has room for the group. The result has the
/// same bits on every machine.
Correction CorrectWeights(const MotionGroup& group, const ParameterValues& wanted,
                          const CorrectionLimits& limits, CorrectionScratch& scratch,
                          Movement& movement,
                          const std::optional<StrideVariation>& variation = std::nullopt);

}  // namespace stridewire
