#include "runtime/pose/reference_evaluation.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "runtime/pose/cell_weights.h"

namespace stridewire {
namespace {

constexpr float kSmallestNorm = 0.1f;

// A row of a grid: one example at one grid point.
struct Row {
  const float* floats;
  const GridLayout& layout;
  [[nodiscard]] Quat rotation(std::size_t j) const { return GridLayout::RotationOf(floats, j); }
  [[nodiscard]] DVec3 position() const { return layout.RootOf(floats).position_m; }
  [[nodiscard]] double yaw() const { return layout.RootOf(floats).yaw_rad; }
};

// A pose in the base frame, with the yaw of the root stored separately.
struct LocalPose {
  std::vector<Quat> rotations;
  DVec3 position{0.0};
  double yaw_rad = 0.0;
};

Row ExampleRow(const MotionGroup& group, const GridLayout& layout, int point, std::size_t example) {
  const auto rows = static_cast<std::size_t>(point) * static_cast<std::size_t>(group.example_count);
  return {&group.grid[(rows + example) * static_cast<std::size_t>(layout.row_floats)], layout};
}

// Blends all examples at all points of a cell in a single sum, so that rotations are normalized
// only once.
LocalPose BlendCell(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                    const CellWeights& cell) {
  LocalPose pose;
  const std::size_t largest = static_cast<std::size_t>(std::ranges::max_element(movement.weights) -
                                                       movement.weights.begin());
  for (std::size_t j = 0; j < static_cast<std::size_t>(layout.joint_count); ++j) {
    const Quat none(0.0f, 0.0f, 0.0f, 0.0f);
    Quat sum = none;
    Quat of_largest = none;
    for (int k = 0; k < cell.count; ++k) {
      const float weight = cell.weights[static_cast<std::size_t>(k)];
      for (std::size_t e = 0; e < movement.weights.size(); ++e) {
        const Quat q = weight * ExampleRow(group, layout, cell.first + k, e).rotation(j);
        sum = sum + movement.weights[e] * q;
        if (e == largest) of_largest = of_largest + q;
      }
    }
    pose.rotations.push_back(
        Normalise(std::sqrt(Dot(sum, sum)) >= kSmallestNorm ? sum : of_largest));
  }
  for (int k = 0; k < cell.count; ++k) {
    for (std::size_t e = 0; e < movement.weights.size(); ++e) {
      const Row row = ExampleRow(group, layout, cell.first + k, e);
      const double weight =
          static_cast<double>(cell.weights[static_cast<std::size_t>(k)]) * movement.weights[e];
      pose.position += weight * row.position();
      pose.yaw_rad += weight * row.yaw();
    }
  }
  return pose;
}

// Catmull-Rom interpolation between the poses at the grid points of a cell. `at(point)` returns the
// pose at a grid point.
template <typename At>
LocalPose Interpolate(const CellWeights& cell, At&& at) {
  std::vector<LocalPose> poses;
  for (int k = 0; k < cell.count; ++k) poses.push_back(at(cell.first + k));
  LocalPose pose;
  for (std::size_t j = 0; j < poses[1].rotations.size(); ++j) {
    Quat sum(0.0f, 0.0f, 0.0f, 0.0f);
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const Quat& q = poses[k].rotations[j];
      const float sign = Dot(poses[1].rotations[j], q) < 0.0f ? -1.0f : 1.0f;
      sum = sum + sign * cell.weights[k] * q;
    }
    pose.rotations.push_back(Normalise(sum));
  }
  for (std::size_t k = 0; k < poses.size(); ++k) {
    pose.position += static_cast<double>(cell.weights[k]) * poses[k].position;
    pose.yaw_rad += static_cast<double>(cell.weights[k]) * poses[k].yaw_rad;
  }
  return pose;
}

void ToWorld(const LocalPose& local, const Movement& movement, double time_s, PoseSpan out) {
  const double yaw_rad =
      local.yaw_rad + movement.extra_turn_rad * (1.0 - EaseOut(time_s / movement.duration_s()));
  out.root_position_m =
      Vec3(movement.base.position_m + RotateYaw(movement.base.heading_rad, local.position));
  std::ranges::copy(local.rotations, out.rotations.begin());
  out.rotations[0] = YawRotation(movement.base.heading_rad + yaw_rad) * out.rotations[0];
}

// Adds the difference pose: M' = f D + M, that is r = r_M slerp(1, r_D, f), plus the term of the
// velocity of D.
void AddDifference(const Movement& movement, double time_s, PoseSpan out) {
  const double s = (time_s - movement.start_offset_s) / movement.ease_out_s;
  if (s >= 1.0) return;
  const auto f = static_cast<float>(EaseOut(s));
  out.root_position_m += f * movement.difference.root_position_m;
  for (std::size_t j = 0; j < out.rotations.size(); ++j) {
    out.rotations[j] = out.rotations[j] * SlerpFromIdentity(movement.difference.rotations[j], f);
  }
  if (!movement.is_inertial) return;
  const PoseVelocity& velocity = movement.difference_velocity;
  const auto seconds = static_cast<float>(movement.ease_out_s * EaseOutSlope(s));
  out.root_position_m += seconds * velocity.root_m_s;
  for (std::size_t j = 0; j < out.rotations.size(); ++j) {
    const Vec3 half = 0.5f * seconds * velocity.joints_rad_s[j];
    out.rotations[j] = out.rotations[j] * Normalise(Quat(1.0f, half.x, half.y, half.z));
  }
}

}  // namespace

void EvaluateMovementByReference(const MotionGroup& group, const GridLayout& layout,
                                 const Movement& movement, double time_s, PoseSpan out) {
  const CellWeights cell =
      CellWeightsAt(movement.warp.GridPosition(time_s), group.grid_point_count);
  ToWorld(BlendCell(group, layout, movement, cell), movement, time_s, out);
  AddDifference(movement, time_s, out);
}

void EvaluateMovementBySampling(const MotionGroup& group, const GridLayout& layout,
                                const Movement& movement, double time_s, PoseSpan out) {
  const CellWeights cell =
      CellWeightsAt(movement.warp.GridPosition(time_s), group.grid_point_count);
  LocalPose sum;
  sum.rotations.resize(out.rotations.size(), Quat(0.0f, 0.0f, 0.0f, 0.0f));
  for (std::size_t e = 0; e < movement.weights.size(); ++e) {
    const float weight = movement.weights[e];
    if (weight == 0.0f) continue;
    const LocalPose pose = Interpolate(cell, [&](int point) {
      const Row row = ExampleRow(group, layout, point, e);
      LocalPose at{.position = row.position(), .yaw_rad = row.yaw()};
      for (std::size_t j = 0; j < out.rotations.size(); ++j) {
        at.rotations.push_back(row.rotation(j));
      }
      return at;
    });
    for (std::size_t j = 0; j < out.rotations.size(); ++j) {
      const Quat& q = pose.rotations[j];
      sum.rotations[j] =
          sum.rotations[j] + (Dot(sum.rotations[j], q) < 0.0f ? -weight : weight) * q;
    }
    sum.position += static_cast<double>(weight) * pose.position;
    sum.yaw_rad += weight * pose.yaw_rad;
  }
  for (Quat& q : sum.rotations) q = Normalise(q);
  ToWorld(sum, movement, time_s, out);
  AddDifference(movement, time_s, out);
}

}  // namespace stridewire
