#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <span>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// The examples' weighted sums at the grid points a pose needs. Summing costs n multiply-adds a number;
/// between grid points the sums are only interpolated. Keeping this or starting from an
/// empty one gives the same bytes. Some kilobytes, for the stack: it allocates nothing.
class GridCache {
 public:
  explicit GridCache(const GridLayout& layout)
      : row_floats_(static_cast<std::size_t>(layout.row_floats)),
        slot_count_(std::min(kMaxSlots, std::bit_floor(rows_.size() / row_floats_))) {
    Clear();
  }

  /// Forgets the rows: the movement changed.
  void Clear() { points_.fill(-1); }

  /// The sum at a grid point. Its quaternions are not unit: what is interpolated between them is made so.
  [[nodiscard]] std::span<const float> Row(const MotionGroup& group, std::span<const float> weights,
                                           int point);

 private:
  // Of most movements all points; of the longest rows the four around one place.
  static constexpr std::size_t kMaxSlots = 32;
  std::size_t row_floats_;
  std::size_t slot_count_;  // a power of two
  std::array<float, 4 * kMaxRowFloats>
      rows_;                           // point p in slot p % slot_count_; not all are filled
  std::array<int, kMaxSlots> points_;  // [slot], -1: none
};

/// The blended pose at a grid point: EvaluateBlend's there. Never allocates.
void EvaluateGridPoint(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                       int point, GridCache& cache, PoseSpan out);

/// The blended pose M(t) in the world, without the difference pose (Eq. (2)). `time_s` is clamped
/// to the movement. Between grid points C1 (Catmull-Rom). Never allocates.
void EvaluateBlend(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                   double time_s, GridCache& cache, PoseSpan out);

/// What is displayed: M'(t) = f(s) D + M(t) with s = (t - start_offset_s)/T (Eq. (5)). M'(start_offset_s) = P and
/// M'(t) = M(t) from T on. If it is inertial, f(s) D is followed by T h(s) V with V the difference's velocity.
void EvaluateMovement(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                      double time_s, GridCache& cache, PoseSpan out);

/// Poses this far apart tell how fast they change.
inline constexpr double kBlendStepS = 0.004;

/// Sets the velocity of a difference pose that is there, from `before`, which was displayed when the movement
/// was entered, and `earlier`, kBlendStepS before that. `scratch` has one rotation a joint. Never allocates if
/// the velocity has room for all joints.
void SetDifferenceVelocity(const MotionGroup& group, const GridLayout& layout, ConstPoseSpan before,
                           ConstPoseSpan earlier, GridCache& cache, PoseSpan scratch,
                           Movement& movement);

}  // namespace stridewire
