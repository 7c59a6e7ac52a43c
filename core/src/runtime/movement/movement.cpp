#include "stridewire/runtime/movement.h"

#include <algorithm>
#include <cmath>

#include "runtime/library/cardinal_basis.h"
#include "runtime/pose/pose_kernels.h"

namespace stridewire {
namespace {

// Limits on the speed of a difference pose; no body moves faster. They bound the overshoot of a
// blend to 4/27 of this speed times the length of the blend.
constexpr float kMaxJointRadPerS = 20.0f;
constexpr float kMaxRootMPerS = 4.0f;

Vec3 NoFaster(const Vec3& velocity, float most) {
  const float speed = std::sqrt(glm::dot(velocity, velocity));
  return speed > most ? velocity * (most / speed) : velocity;
}

// A small rotation as a rotation vector. The length is approximate (2 sin(angle / 2)), which avoids
// trigonometry that differs between machines.
Vec3 RotationVector(const Quat& q) {
  const float sign = q.w < 0.0f ? -2.0f : 2.0f;
  return sign * Vec3(q.x, q.y, q.z);
}

}  // namespace

std::span<const float> GridCache::Row(const MotionGroup& group, std::span<const float> weights,
                                      int point) {
  const std::size_t slot = static_cast<std::size_t>(point) & (slot_count_ - 1);
  const std::span<float> row = std::span(rows_).subspan(slot * row_floats_, row_floats_);
  if (points_[slot] == point) return row;
  points_[slot] = point;
  const std::size_t n = weights.size();
  const float* examples = &group.grid[static_cast<std::size_t>(point) * n * row_floats_];
  kernels::SumRows(examples, weights.data(), n, row_floats_, row.data());
  return row;
}

double EaseOut(double s) {
  if (s <= 0.0) return 1.0;
  if (s >= 1.0) return 0.0;
  const double r = 1.0 - s;
  return r * r * (3.0 - 2.0 * r);
}

double EaseOutSlope(double s) {
  if (s <= 0.0 || s >= 1.0) return 0.0;
  return s * (1.0 - s) * (1.0 - s);
}

void SetDifferenceVelocity(const MotionGroup& group, const GridLayout& layout, ConstPoseSpan before,
                           ConstPoseSpan earlier, GridCache& cache, PoseSpan scratch,
                           Movement& movement) {
  // Before its start, a movement is extrapolated by reflecting its first moments.
  const bool is_reflected = movement.start_offset_s < kBlendStepS;
  EvaluateBlend(group, layout, movement,
                movement.start_offset_s + (is_reflected ? kBlendStepS : -kBlendStepS), cache,
                scratch);
  const auto per_s = static_cast<float>(1.0 / kBlendStepS);
  const Pose& difference = movement.difference;
  const Vec3 entered_m = before.root_position_m - difference.root_position_m;
  const Vec3 blend_m =
      is_reflected ? 2.0f * entered_m - scratch.root_position_m : scratch.root_position_m;
  movement.difference_velocity.root_m_s = NoFaster(
      per_s * (difference.root_position_m - (earlier.root_position_m - blend_m)), kMaxRootMPerS);
  movement.difference_velocity.joints_rad_s.resize(before.rotations.size());
  for (std::size_t j = 0; j < before.rotations.size(); ++j) {
    const Quat entered = before.rotations[j] * glm::conjugate(difference.rotations[j]);
    const Quat blend = is_reflected ? entered * (glm::conjugate(scratch.rotations[j]) * entered)
                                    : scratch.rotations[j];
    const Quat was = glm::conjugate(blend) * earlier.rotations[j];
    movement.difference_velocity.joints_rad_s[j] = NoFaster(
        per_s * RotationVector(glm::conjugate(was) * difference.rotations[j]), kMaxJointRadPerS);
  }
  movement.is_inertial = true;
}

void SetWeights(const MotionGroup& group, int group_index, std::span<const double> parameters,
                std::span<double> weight_scratch, Movement& movement) {
  const auto n = static_cast<std::size_t>(group.example_count);
  movement.group = group_index;
  movement.parameters.count = static_cast<int>(parameters.size());
  std::copy(parameters.begin(), parameters.end(), movement.parameters.values.begin());
  const std::span<double> weights = weight_scratch.first(n);
  if (n == 1) {
    weights[0] = 1.0;
  } else {
    std::array<double, kMaxParameters> centres{};
    std::array<double, kMaxParameters> scales{};
    for (std::size_t l = 0; l < group.parameters.size(); ++l) {
      centres[l] = group.parameters[l].centre;
      scales[l] = group.parameters[l].scale;
    }
    const std::size_t d = group.parameters.size();
    EvaluateWeights({std::span(centres).first(d), std::span(scales).first(d), group.sites,
                     group.dilations, group.linear, group.radial},
                    parameters, weights);
  }
  TakeWeights(group, weights, movement);
}

void TakeWeights(const MotionGroup& group, std::span<const double> weights, Movement& movement) {
  movement.weights.resize(weights.size());
  movement.heading_change_rad = 0.0;
  for (std::size_t e = 0; e < weights.size(); ++e) {
    movement.weights[e] = static_cast<float>(weights[e]);
    movement.heading_change_rad += weights[e] * group.heading_change_rad[e];
  }
}

void StartMovement(const MotionGroup& group, int group_index, std::span<const double> parameters,
                   const BaseFrame& base, std::span<double> weight_scratch, Movement& movement) {
  SetWeights(group, group_index, parameters, weight_scratch, movement);
  StartWeighted(group, base, movement);
}

void StartWeighted(const MotionGroup& group, const BaseFrame& base, Movement& movement) {
  movement.base = base;
  movement.extra_turn_rad = 0.0;
  movement.start_offset_s = 0.0;
  movement.is_inertial = false;
  std::array<double, kMaxIntervals + 1> scratch;
  const auto keytimes = std::span(scratch).first(group.cells.size() + 1);
  BlendKeytimes(group.keytimes_s, movement.weights, keytimes);
  movement.warp = TimeWarp(keytimes, group.cells);
  movement.ease_out_s = std::min(kEaseOutS, movement.duration_s());
}

BaseFrame BaseAfter(const Movement& movement, ConstPoseSpan end_pose) {
  BaseFrame base = movement.base;
  base.position_m.x = end_pose.root_position_m.x;
  base.position_m.z = end_pose.root_position_m.z;
  base.heading_rad += movement.heading_change_rad + movement.extra_turn_rad;
  return base;
}

}  // namespace stridewire
