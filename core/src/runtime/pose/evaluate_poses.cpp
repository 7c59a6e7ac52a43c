#include "runtime/pose/evaluate_poses.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/pose/cell_weights.h"
#include "runtime/pose/grid_blend.h"
#include "runtime/pose/pose_kernels.h"

namespace stridewire {
namespace {

// Limits on the velocity of a difference pose. Human bodies do not move faster. The velocity adds
// at most 4/27 of itself times the duration of the blend to the difference pose (EaseOutSlope).
constexpr float kMaxJointRadPerS = 20.0f;
constexpr float kMaxRootMPerS = 4.0f;

Vec3 NoFaster(const Vec3& velocity, float most) {
  const float speed = std::sqrt(glm::dot(velocity, velocity));
  return speed > most ? velocity * (most / speed) : velocity;
}

// Converts a small rotation to a rotation vector. The length of the vector is 2 sin(angle / 2),
// which is close to the angle and needs no trigonometry of the C library, which differs between
// machines.
Vec3 RotationVector(const Quat& q) {
  const float sign = q.w < 0.0f ? -2.0f : 2.0f;
  return sign * Vec3(q.x, q.y, q.z);
}

}  // namespace

void GridCache::SumExamples(const MotionGroup& group, std::span<const float> weights, int point,
                            float* row) const {
  const std::size_t n = weights.size();
  const float* examples = &group.grid[static_cast<std::size_t>(point) * n * row_floats_];
  kernels::SumRows(examples, weights.data(), n, row_floats_, row);
}

void UseLargestExample(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                       const GridSample& sample, float* row) {
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  const std::vector<float>& weights = movement.weights;
  const auto largest =
      static_cast<std::size_t>(std::max_element(weights.begin(), weights.end()) - weights.begin());
  for (std::size_t j = 0; j < static_cast<std::size_t>(layout.joint_count); ++j) {
    float square = 0.0f;
    for (std::size_t i = 4 * j; i < 4 * j + 4; ++i) square += row[i] * row[i];
    if (square >= kernels::kSmallestNorm * kernels::kSmallestNorm) continue;
    for (std::size_t i = 4 * j; i < 4 * j + 4; ++i) {
      float& sum = row[i];
      sum = 0.0f;
      for (int k = 0; k < 4; ++k) {
        const auto examples = static_cast<std::size_t>(GridPointOf(group, sample, k)) *
                              static_cast<std::size_t>(group.row_count());
        sum += sample.weights[static_cast<std::size_t>(k)] *
               group.grid[(examples + largest) * row_floats + i];
      }
    }
  }
}

namespace {

// The position of a pose in its movement, and the difference pose and turn that remain there.
struct PoseSample {
  GridSample grid;
  float fraction;  // Remaining fraction of the difference pose.
  // Factor in seconds by which the velocity of the difference pose is multiplied.
  float slope_s;
  double remaining_turn;  // Fraction of Movement::extra_turn_rad that is still to come.
  bool is_eased;          // True while part of the difference remains.
};

using RowScratch = std::array<float, kMaxRowFloats>;

// Normalizes the rotations, adds the rest of the difference pose and transforms the pose into world
// space.
void FinishPose(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                const PoseSample& sample, RowScratch& row, PoseSpan out) {
  const bool is_inertial = sample.is_eased && movement.is_inertial;
  const kernels::RotationBlend rotations = {
      .row = row.data(),
      .joint_count = static_cast<std::size_t>(layout.joint_count),
      .difference = sample.is_eased ? &movement.difference.rotations[0].x : nullptr,
      .fraction = sample.fraction,
      .velocity = is_inertial ? &movement.difference_velocity.joints_rad_s[0].x : nullptr,
      .seconds = sample.slope_s};
  if (!kernels::BlendRotations(rotations, &out.rotations[0].x)) {
    UseLargestExample(group, layout, movement, sample.grid, row.data());
    (void)kernels::BlendRotations(rotations, &out.rotations[0].x);
  }
  const GridLayout::Root root = layout.RootOf(row.data());
  const BaseFrame& base = movement.base;
  const double yaw_rad = root.yaw_rad + movement.extra_turn_rad * (1.0 - sample.remaining_turn);
  const std::array<double, 2> angles_rad = {base.heading_rad, 0.5 * (base.heading_rad + yaw_rad)};
  std::array<double, 2> sines;
  std::array<double, 2> cosines;
  kernels::SinCos(angles_rad.data(), 2, sines.data(), cosines.data());
  const DVec3& local = root.position_m;
  out.root_position_m =
      Vec3(base.position_m + DVec3(cosines[0] * local.x + sines[0] * local.z, local.y,
                                   cosines[0] * local.z - sines[0] * local.x));
  out.rotations[0] =
      Quat(static_cast<float>(cosines[1]), 0.0f, static_cast<float>(sines[1]), 0.0f) *
      out.rotations[0];
  if (!sample.is_eased) return;
  out.root_position_m += sample.fraction * movement.difference.root_position_m;
  if (movement.is_inertial) {
    out.root_position_m += sample.slope_s * movement.difference_velocity.root_m_s;
  }
}

// Performs the operations of kernels::ComputeGridSamples for a single time. For one time, scalar
// code is faster.
PoseSample SampleAt(const MotionGroup& group, const Movement& movement, double time_s) {
  const CellWeights cell =
      CellWeightsAt(movement.warp.GridPosition(time_s), group.grid_point_count);
  const double eased = (time_s - movement.start_offset_s) / movement.ease_out_s;
  return {.grid = {cell.first, cell.weights},
          .fraction = static_cast<float>(EaseOut(eased)),
          .slope_s = static_cast<float>(movement.ease_out_s * EaseOutSlope(eased)),
          .remaining_turn = EaseOut(time_s / movement.warp.duration_s()),
          .is_eased = eased < 1.0};
}

void EvaluateAt(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                const PoseSample& sample, GridCache& cache, PoseSpan out) {
  RowScratch row;
  BlendRow(group, layout, movement, sample.grid, cache, row.data());
  FinishPose(group, layout, movement, sample, row, out);
}

}  // namespace

void EvaluateGridPoint(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                       int point, GridCache& cache, PoseSpan out) {
  const PoseSample sample = {.grid = {point, {1.0f, 0.0f, 0.0f, 0.0f}},
                             .fraction = 0.0f,
                             .slope_s = 0.0f,
                             .remaining_turn = 1.0,
                             .is_eased = false};
  RowScratch row;
  std::ranges::copy(cache.Row(group, movement.weights, point), row.begin());
  FinishPose(group, layout, movement, sample, row, out);
}

void EvaluateBlend(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                   double time_s, GridCache& cache, PoseSpan out) {
  PoseSample sample = SampleAt(group, movement, time_s);
  sample.is_eased = false;
  EvaluateAt(group, layout, movement, sample, cache, out);
}

void EvaluateMovement(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                      double time_s, GridCache& cache, PoseSpan out) {
  EvaluateAt(group, layout, movement, SampleAt(group, movement, time_s), cache, out);
}

void SetDifferenceVelocity(const MotionGroup& group, const GridLayout& layout, ConstPoseSpan before,
                           ConstPoseSpan earlier, GridCache& cache, PoseSpan scratch,
                           Movement& movement) {
  // The velocity requires the pose of the movement kBlendStepS before the blend begins. If the
  // movement has no such pose, the pose kBlendStepS after the beginning of the blend is reflected
  // at the pose at its beginning.
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

}  // namespace stridewire
