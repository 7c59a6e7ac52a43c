#pragma once

#include <algorithm>
#include <array>

#include "runtime/library/keytimes.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/pose_kernels.h"

namespace stridewire {

/// The four grid points between which a pose is interpolated.
struct GridSample {
  int first_point;               ///< Index of the first of the four points.
  std::array<float, 4> weights;  ///< Weight of each point.
};

/// Returns the index of point `k` of a sample. For a point beyond the last grid point, returns the
/// last grid point. The weight of such a point is zero, but its row is read nevertheless.
[[nodiscard]] inline int GridPointOf(const MotionGroup& group, const GridSample& sample, int k) {
  return std::min(sample.first_point + k, group.grid_point_count - 1);
}

/// Copies a piece of a time warp to a lane of `times`.
inline void SetWarpPiece(const TimeWarp::Piece& piece, std::size_t lane,
                         kernels::GridTimes& times) {
  times.begin_s[lane] = piece.begin_s;
  times.end_s[lane] = piece.end_s;
  times.begin[lane] = piece.begin;
  times.end[lane] = piece.end;
  times.begin_slope[lane] = piece.begin_slope;
  times.end_slope[lane] = piece.end_slope;
}

/// Sets a lane of `times` to a time of a movement.
inline void SetGridTime(const MotionGroup& group, const Movement& movement, double time_s,
                        std::size_t lane, kernels::GridTimes& times) {
  times.time_s[lane] = time_s;
  SetWarpPiece(movement.warp.PieceAt(time_s), lane, times);
  times.last_cell[lane] = group.grid_point_count - 2;
  times.duration_s[lane] = movement.warp.duration_s();
  times.start_offset_s[lane] = movement.start_offset_s;
  times.ease_out_s[lane] = movement.ease_out_s;
}

/// Returns the sample of one lane.
[[nodiscard]] inline GridSample GridSampleOf(const kernels::GridSamples& samples,
                                             std::size_t lane) {
  return {samples.first_point[lane],
          {samples.weights[0][lane], samples.weights[1][lane], samples.weights[2][lane],
           samples.weights[3][lane]}};
}

/// Writes the blended row at `sample` to `row`. Its rotations are not normalized.
inline void BlendRow(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                     const GridSample& sample, GridCache& cache, float* row) {
  std::array<const float*, 4> points;
  for (int k = 0; k < 4; ++k) {
    const int point = GridPointOf(group, sample, k);
    points[static_cast<std::size_t>(k)] = cache.Row(group, movement.weights, point).data();
  }
  kernels::BlendPoints(points.data(), sample.weights.data(),
                       static_cast<std::size_t>(layout.row_floats), row);
}

/// Replaces rotations of a blended row that are shorter than kernels::kSmallestNorm with those of
/// the example with the largest weight. The examples' rotations of these joints cancel each other
/// out and have no mean.
void UseLargestExample(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                       const GridSample& sample, float* row);

}  // namespace stridewire
