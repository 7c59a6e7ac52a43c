#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/foot_plan.h"
#include "stridewire/runtime/keytimes.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Where a movement starts: a point on the support ground and a heading. Positions of a movement
/// are relative to it: world = position + R_y(heading) * local.
struct BaseFrame {
  DVec3 position_m = DVec3(0.0);
  double heading_rad = 0.0;  ///< Unwrapped: 2 pi is one full left turn.
};

/// A movement may be turned this much further, or less, than its examples turn.
inline constexpr double kMaxExtraTurnRad = 0.3;

/// The longest an old pose is eased out over (paper, Section 5: T).
inline constexpr double kEaseOutS = 0.2;

/// How what is displayed is brought onto a movement that begins.
enum class BlendKind : std::uint8_t {
  kCubic,     ///< The difference fades from rest (paper, Eq. (5)): joints may change speed at once.
  kInertialization,  ///< It goes on as fast as it did while it fades: no joint changes its speed at once.
};

/// How fast a pose changes: of each joint as a rotation vector in the joint's own frame.
struct PoseVelocity {
  Vec3 root_m_s = Vec3(0.0f);
  std::vector<Vec3> joints_rad_s;
};

/// One synthesized variation: everything that can be seen of an avatar while it lasts follows from
/// this value, its group and the time.
struct Movement {
  // First what each of its poses is made of, in few lines of a cache.
  int group = -1;
  bool is_inertial = false;  ///< There is a difference_velocity
  BaseFrame base;
  double extra_turn_rad = 0.0;  ///< Turned further than its examples turn, evenly over the movement
  double start_offset_s = 0.0;  ///< Where it began: later than 0 if it took over in mid-swing
  double ease_out_s = kEaseOutS;     ///< T = min(kEaseOutS, duration)
  std::vector<float> weights;        ///< [example], sum 1
  Pose difference;                   ///< D = P - M(start_offset_s), world frame
  PoseVelocity difference_velocity;  ///< Of D when the movement was entered
  TimeWarp warp;                     ///< Of the blended keytimes
  FootPlan feet;                     ///< Not active: feet are where the blend has them

  ParameterValues parameters;       ///< What was asked of it
  double heading_change_rad = 0.0;  ///< blended

  [[nodiscard]] double duration_s() const { return warp.duration_s(); }
};

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

/// Fills `movement` (its vectors keep their memory) for a group and parameters [d] at a base frame:
/// weights (Section 3), keytimes (Eq. (4)), ease-out time; no difference pose.
void StartMovement(const MotionGroup& group, int group_index, std::span<const double> parameters,
                   const BaseFrame& base, std::span<double> weight_scratch, Movement& movement);

/// The part of StartMovement that decides the poses at both ends: group, weights and heading change.
void SetWeights(const MotionGroup& group, int group_index, std::span<const double> parameters,
                std::span<double> weight_scratch, Movement& movement);

/// Gives the movement other weights [n] of its group, and the heading change that follows.
void TakeWeights(const MotionGroup& group, std::span<const double> weights, Movement& movement);

/// The rest of StartMovement, for a movement that has group, parameters and weights.
void StartWeighted(const MotionGroup& group, const BaseFrame& base, Movement& movement);

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

/// f(s) = 3(1-s)^2 - 2(1-s)^3, 1 at 0, 0 from 1 on.
[[nodiscard]] double EaseOut(double s);

/// h(s) = s (1-s)^2: 0 at both ends, of slope 1 at 0; with f the cubic through any value and slope at 0.
[[nodiscard]] double EaseOutSlope(double s);

/// Poses this far apart tell how fast they change.
inline constexpr double kBlendStepS = 0.004;

/// Sets the velocity of a difference pose that is there, from `before`, which was displayed when the movement
/// was entered, and `earlier`, kBlendStepS before that. `scratch` has one rotation a joint. Never allocates if
/// the velocity has room for all joints.
void SetDifferenceVelocity(const MotionGroup& group, const GridLayout& layout, ConstPoseSpan before,
                           ConstPoseSpan earlier, GridCache& cache, PoseSpan scratch,
                           Movement& movement);

/// Base frame after the movement: below the displayed root at its end, heading turned by the blended
/// change (the paper takes the displayed heading, which swings with the pelvis and veers).
[[nodiscard]] BaseFrame BaseAfter(const Movement& movement, ConstPoseSpan end_pose);

}  // namespace stridewire
