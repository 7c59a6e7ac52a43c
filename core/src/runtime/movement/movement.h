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

/// Default of RequestPlan::max_extra_turn_rad. Steps of walks may turn further (StepPlanner).
inline constexpr double kMaxExtraTurnRad = 0.3;

/// Limits on the playback speed of a movement.
inline constexpr double kMinRate = 0.5;
inline constexpr double kMaxRate = 2.0;

/// Velocity of a pose: for each joint a rotation vector per second, in the joint's own frame.
struct PoseVelocity {
  Vec3 root_m_s = Vec3(0.0f);
  std::vector<Vec3> joints_rad_s;
};

/// One synthesized movement. While it lasts, this value, its group and the time determine the
/// displayed pose without layers.
struct Movement {
  // The members that are read for each pose come first, in few cache lines.
  int group = -1;
  bool is_inertial = false;  ///< True if difference_velocity is set.
  BaseFrame base;
  /// Turn in addition to that of the examples, eased over the movement.
  double extra_turn_rad = 0.0;
  /// Time at which the avatar enters the movement, in seconds since its first keytime. Above 0 if
  /// it continues a redirected swing, if it is a jump that interrupts another movement, and for
  /// idle motion.
  double start_offset_s = 0.0;
  double ease_out_s = kEaseOutS;  ///< Seconds over which the difference pose fades out (T).
  double rate = 1.0;              ///< Playback speed relative to the examples, > 0.
  std::vector<float> weights;     ///< [row]: blend weights, whose sum is 1.
  /// Difference pose D = P - M in world space. P is the last pose of the previous movement, without
  /// planting if the feet are planted. M is the blended pose of this movement at start_offset_s.
  Pose difference;
  PoseVelocity difference_velocity;  ///< Velocity of D at start_offset_s.
  TimeWarp warp;                     ///< Time warp of the blended keytimes.
  /// Plan of the feet. If it is not active, feet follow the blended pose.
  FootPlan feet;

  /// Requested parameters after clamping to the enlarged hull of the examples
  /// (RequestPlan::applied).
  ParameterValues parameters;
  double heading_change_rad = 0.0;  ///< Blended heading change of the examples.

  [[nodiscard]] double duration_s() const { return warp.duration_s(); }
};

/// Sets the weights (paper, Section 3), the keytimes (Eq. (4)) and the ease-out time of `movement`
/// for a group, parameters [d] and a base frame. Does not set a difference pose. Reuses the memory
/// of the vectors in `movement`.
void StartMovement(const MotionGroup& group, int group_index, std::span<const double> parameters,
                   const BaseFrame& base, std::span<double> weight_scratch, Movement& movement);

/// Sets only what determines the first and last pose: group, weights and heading change. This is a
/// part of StartMovement.
void SetWeights(const MotionGroup& group, int group_index, std::span<const double> parameters,
                std::span<double> weight_scratch, Movement& movement);

/// Replaces the weights of a movement with those of the examples [n] and 0 for the variants, and
/// sets the heading change that follows from them.
void ApplyWeights(const MotionGroup& group, std::span<const double> weights, Movement& movement);

/// Adds `weight` to the weight of a variant, and updates the heading change.
void AddVariant(const MotionGroup& group, int variant, double weight, Movement& movement);

/// Performs the rest of StartMovement for a movement whose group, parameters and weights are set.
/// `rate` divides all keytimes, so that all times of the movement are in seconds of the avatar.
void StartWeighted(const MotionGroup& group, const BaseFrame& base, Movement& movement,
                   double rate = 1.0);

/// Returns f(s) = 3(1-s)^2 - 2(1-s)^3, the remaining fraction of a difference pose. It is 1 for
/// s <= 0 and 0 for s >= 1.
[[nodiscard]] inline double EaseOut(double s) {
  if (s <= 0.0) return 1.0;
  if (s >= 1.0) return 0.0;
  const double r = 1.0 - s;
  return r * r * (3.0 - 2.0 * r);
}

/// Returns h(s) = s (1-s)^2, which is zero at both ends and has slope 1 at 0. Together with f(s) of
/// EaseOut, it forms a cubic that has any given value and slope at 0 and ends at rest.
[[nodiscard]] inline double EaseOutSlope(double s) {
  if (s <= 0.0 || s >= 1.0) return 0.0;
  return s * (1.0 - s) * (1.0 - s);
}

/// Returns the base frame after the movement: below the displayed root at its end, with the heading
/// turned by the blended change. The paper uses the displayed heading instead. That heading
/// oscillates with the pelvis, so walks would drift.
[[nodiscard]] BaseFrame BaseAfter(const Movement& movement, ConstPoseSpan end_pose);

}  // namespace stridewire
