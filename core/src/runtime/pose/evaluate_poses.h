#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <span>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Caches the weighted sums of the examples of a movement at grid points. A sum over n examples
/// costs n multiply-adds per number, whereas a pose between grid points is interpolated from only
/// four such sums. Results do not depend on the state of the cache. A cache takes 17 KB and never
/// allocates.
class GridCache {
 public:
  explicit GridCache(const GridLayout& layout)
      : row_floats_(static_cast<std::size_t>(layout.row_floats)),
        slot_count_(std::min(kMaxSlots, std::bit_floor(kRowsFloats / row_floats_))) {
    Clear();
  }

  /// Removes all rows. Call it when the movement changes.
  void Clear() { points_.fill(-1); }

  /// Returns the weighted sum at a grid point. Its quaternions are not normalized.
  [[nodiscard]] std::span<const float> Row(const MotionGroup& group, std::span<const float> weights,
                                           int point) {
    const std::size_t slot = static_cast<std::size_t>(point) & (slot_count_ - 1);
    float* row = &rows_[slot * row_floats_];
    if (points_[slot] != point) {
      points_[slot] = point;
      SumExamples(group, weights, point, row);
    }
    return {row, row_floats_};
  }

 private:
  void SumExamples(const MotionGroup& group, std::span<const float> weights, int point,
                   float* row) const;

  // Maximum number of cached grid points. Skeletons with up to 31 joints have this many slots,
  // which is sufficient for all points of most movements. With rows of the maximum length, only the
  // four points around a time fit.
  static constexpr std::size_t kMaxSlots = 32;
  static constexpr std::size_t kRowsFloats = 4 * kMaxRowFloats;
  std::size_t row_floats_;
  std::size_t slot_count_;               // Number of slots, a power of two.
  std::array<float, kRowsFloats> rows_;  // Point p is in slot p % slot_count_.
  std::array<int, kMaxSlots> points_;    // [slot]: grid point stored in the slot, or -1.
};

/// Evaluates the blended pose at a grid point in world space, without the difference pose and
/// without Movement::extra_turn_rad. Never allocates.
void EvaluateGridPoint(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                       int point, GridCache& cache, PoseSpan out);

/// Evaluates the blended pose M(t) in world space, without the difference pose (Eq. (2)). `time_s`
/// is clamped to the movement. The motion is C1 (Catmull-Rom). Never allocates.
void EvaluateBlend(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                   double time_s, GridCache& cache, PoseSpan out);

/// Evaluates the pose with the difference pose D = Movement::difference (paper, Eq. (5)):
///
///   M'(t) = f(s) D + M(t),   s = (t - start_offset_s) / T,   T = ease_out_s,   f = EaseOut
///
/// At start_offset_s, this is the pose that the movement blends from. For s >= 1, it is M(t). If
/// the movement is inertial, T h(s) V is added, where V is the velocity of D and h is EaseOutSlope.
void EvaluateMovement(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                      double time_s, GridCache& cache, PoseSpan out);

/// Time in seconds between the two poses from which a velocity is measured.
inline constexpr double kBlendStepS = 0.004;

/// Sets Movement::difference_velocity and Movement::is_inertial. The difference pose must be set.
/// `before` is the pose of the previous movement at the start of `movement`, and `earlier` is the
/// pose of the previous movement kBlendStepS before that. `scratch` has one rotation per joint.
/// Does not allocate if the velocity has room for all joints.
void SetDifferenceVelocity(const MotionGroup& group, const GridLayout& layout, ConstPoseSpan before,
                           ConstPoseSpan earlier, GridCache& cache, PoseSpan scratch,
                           Movement& movement);

}  // namespace stridewire
