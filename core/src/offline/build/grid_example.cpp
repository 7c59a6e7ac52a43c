#include "offline/build/grid_example.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "runtime/library/keytimes.h"

namespace stridewire {
namespace {

std::size_t MedoidIndex(const std::vector<GridExample>& examples) {
  const std::size_t d = examples.front().parameters.size();
  std::vector<double> mean(d, 0.0);
  for (const GridExample& example : examples) {
    for (std::size_t l = 0; l < d; ++l) {
      mean[l] += example.parameters[l] / static_cast<double>(examples.size());
    }
  }
  std::size_t best = 0;
  double best_distance = HUGE_VAL;
  for (std::size_t e = 0; e < examples.size(); ++e) {
    double distance = 0.0;
    for (std::size_t l = 0; l < d; ++l) {
      const double difference = examples[e].parameters[l] - mean[l];
      distance += difference * difference;
    }
    if (distance < best_distance) {
      best_distance = distance;
      best = e;
    }
  }
  return best;
}

void Flip(float* row, std::size_t joint) {
  GridLayout::SetRotation(row, joint, -GridLayout::RotationOf(row, joint));
}

float DotOfRows(const float* a, const float* b, std::size_t joint) {
  return Dot(GridLayout::RotationOf(a, joint), GridLayout::RotationOf(b, joint));
}

}  // namespace

void SampleExample(const RawExample& example, double time_s, PoseSpan out) {
  const Clip& clip = example.clip;
  const std::vector<double>& times_s = example.frame_times_s;
  if (times_s.empty()) return SampleClip(clip, time_s, out);
  const auto after = std::ranges::lower_bound(times_s, time_s);
  const auto f = std::min(after - times_s.begin(), std::ssize(times_s) - 1);
  if (f == 0 || times_s[static_cast<std::size_t>(f)] <= time_s) {
    const ConstPoseSpan frame = clip.frame(static_cast<int>(f));
    out.root_position_m = frame.root_position_m;
    std::ranges::copy(frame.rotations, out.rotations.begin());
    return;
  }
  const auto i = static_cast<std::size_t>(f);
  const double part = (time_s - times_s[i - 1]) / (times_s[i] - times_s[i - 1]);
  SampleClip(clip, (static_cast<double>(i - 1) + part) / clip.fps, out);
}

GridExample ResampleOnGrid(const RawExample& example, std::span<const int> cells,
                           const GridLayout& layout, const Quat& stand_root) {
  STRIDEWIRE_CHECK(example.keytimes_s.size() == cells.size() + 1);
  const TimeWarp warp(example.keytimes_s, cells);
  std::vector<double> times_s{warp.TimeAt(0.0)};
  for (const int count : cells) {
    for (int i = 0; i < count; ++i) {
      times_s.push_back(warp.TimeAt(static_cast<double>(times_s.size())));
    }
  }
  return ResampleAt(example, times_s, layout, stand_root);
}

GridExample ResampleAt(const RawExample& example, std::span<const double> times_s,
                       const GridLayout& layout, const Quat& stand_root) {
  STRIDEWIRE_CHECK(example.clip.joint_count == layout.joint_count);
  GridExample result;
  result.keytimes_s = example.keytimes_s;
  result.parameters = example.parameters;
  result.heading_change_rad = example.heading_change_rad;
  result.source = example.source;
  result.mirrored = example.mirrored;
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  result.rows.assign(times_s.size() * row_floats, 0.0f);

  Pose pose(example.clip.joint_count);
  double yaw_rad = 0.0;
  for (std::size_t p = 0; p < times_s.size(); ++p) {
    SampleExample(example, times_s[p], pose);
    float* row = &result.rows[p * row_floats];
    double wrapped_rad = yaw_rad;
    // If the forward axis of the root is nearly vertical, HeadingOf leaves the previous yaw
    // unchanged.
    HeadingOf(pose.rotations[0] * glm::conjugate(stand_root), wrapped_rad);
    yaw_rad = UnwrapAngle(wrapped_rad, yaw_rad);
    pose.rotations[0] = YawRotation(-yaw_rad) * pose.rotations[0];
    for (std::size_t j = 0; j < pose.rotations.size(); ++j) {
      Quat rotation = Normalise(pose.rotations[j]);
      // Blending needs quaternions that are continuous in sign; those of the clip may not be.
      if (p > 0 && Dot(GridLayout::RotationOf(row - row_floats, j), rotation) < 0.0f) {
        rotation = -rotation;
      }
      GridLayout::SetRotation(row, j, rotation);
    }
    layout.SetRoot(row, {DVec3(pose.root_position_m), yaw_rad});
  }
  return result;
}

void AlignHemispheres(std::vector<GridExample>& examples, const GridLayout& layout,
                      int joint_count) {
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  STRIDEWIRE_CHECK(!examples.empty());
  for (GridExample& example : examples) {
    for (std::size_t begin = row_floats; begin < example.rows.size(); begin += row_floats) {
      for (std::size_t j = 0; j < static_cast<std::size_t>(joint_count); ++j) {
        float* row = &example.rows[begin];
        if (DotOfRows(row, row - row_floats, j) < 0.0f) Flip(row, j);
      }
    }
  }
  const GridExample& reference = examples[MedoidIndex(examples)];
  for (GridExample& example : examples) {
    AlignHemisphere(reference, layout, joint_count, example);
  }
}

void AlignHemisphere(const GridExample& reference, const GridLayout& layout, int joint_count,
                     GridExample& example) {
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  STRIDEWIRE_CHECK(example.rows.size() == reference.rows.size());
  for (std::size_t j = 0; j < static_cast<std::size_t>(joint_count); ++j) {
    float along = 0.0f;
    for (std::size_t begin = 0; begin < example.rows.size(); begin += row_floats) {
      along += DotOfRows(&example.rows[begin], &reference.rows[begin], j);
    }
    if (along >= 0.0f) continue;
    for (std::size_t begin = 0; begin < example.rows.size(); begin += row_floats) {
      Flip(&example.rows[begin], j);
    }
  }
}

void SetBlendedRow(std::span<const float> sum, const GridLayout& layout, float* row) {
  constexpr float kSmallestNorm = 0.1f;
  for (std::size_t j = 0; j < static_cast<std::size_t>(layout.joint_count); ++j) {
    const Quat q = GridLayout::RotationOf(sum.data(), j);
    const float norm = std::sqrt(Dot(q, q));
    if (norm >= kSmallestNorm) GridLayout::SetRotation(row, j, q * (1.0f / norm));
  }
  layout.SetRoot(row, layout.RootOf(sum.data()));
}

Pose PoseOfRow(std::span<const float> row, const GridLayout& layout, int joint_count) {
  Pose pose(joint_count);
  for (std::size_t j = 0; j < pose.rotations.size(); ++j) {
    pose.rotations[j] = GridLayout::RotationOf(row.data(), j);
  }
  const auto [position, yaw_rad] = layout.RootOf(row.data());
  pose.root_position_m = Vec3(position);
  pose.rotations[0] = YawRotation(yaw_rad) * pose.rotations[0];
  return pose;
}

}  // namespace stridewire
