#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/library/keytimes.h"
#include "runtime/movement/foot_plan.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// A movement may be turned this much further, or less, than its examples turn.
inline constexpr double kMaxExtraTurnRad = 0.3;

/// The longest an old pose is eased out over (paper, Section 5: T).
inline constexpr double kEaseOutS = 0.2;

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

/// Fills `movement` (its vectors keep their memory) for a group and parameters [d] at a base frame:
/// weights (Section 3), keytimes (Eq. (4)), ease-out time; no difference pose.
void StartMovement(const MotionGroup& group, int group_index, std::span<const double> parameters,
                   const BaseFrame& base, std::span<double> weight_scratch, Movement& movement);

/// The part of StartMovement that decides the poses at both ends: group, weights and heading
/// change.
void SetWeights(const MotionGroup& group, int group_index, std::span<const double> parameters,
                std::span<double> weight_scratch, Movement& movement);

/// Gives the movement other weights [n] of its group, and the heading change that follows.
void ApplyWeights(const MotionGroup& group, std::span<const double> weights, Movement& movement);

/// The rest of StartMovement, for a movement that has group, parameters and weights.
void StartWeighted(const MotionGroup& group, const BaseFrame& base, Movement& movement);

/// f(s) = 3(1-s)^2 - 2(1-s)^3, 1 at 0, 0 from 1 on.
[[nodiscard]] double EaseOut(double s);

/// h(s) = s (1-s)^2: 0 at both ends, of slope 1 at 0; with f the cubic through any value and slope
/// at 0.
[[nodiscard]] double EaseOutSlope(double s);

/// Base frame after the movement: below the displayed root at its end, heading turned by the
/// blended change (the paper takes the displayed heading, which swings with the pelvis and veers).
[[nodiscard]] BaseFrame BaseAfter(const Movement& movement, ConstPoseSpan end_pose);

}  // namespace stridewire
