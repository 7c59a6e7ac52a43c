#pragma once

#include <algorithm>
#include <array>

#include "runtime/pose/pose_kernels.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/library/keytimes.h"

namespace stridewire {

/// The rows of a movement's grid that make up a pose.
struct GridPlace {
  int first_point;               ///< Of the four that are interpolated
  std::array<float, 4> weights;  ///< Of them
};

/// Point `k` of a place. One behind the last weighs nothing, but is read.
[[nodiscard]] inline int PointOf(const MotionGroup& group, const GridPlace& place, int k) {
  return std::min(place.first_point + k, group.grid_point_count - 1);
}

/// The piece of a movement's warp that a lane's time is in.
inline void SetPiece(const TimeWarp::Piece& piece, std::size_t lane, kernels::GridTimes& times) {
  times.begin_s[lane] = piece.begin_s;
  times.end_s[lane] = piece.end_s;
  times.begin[lane] = piece.begin;
  times.end[lane] = piece.end;
  times.begin_slope[lane] = piece.begin_slope;
  times.end_slope[lane] = piece.end_slope;
}

/// row = the blended row there. Its rotations are not unit.
inline void BlendRow(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                     const GridPlace& place, GridCache& cache, float* row) {
  std::array<const float*, 4> points;
  for (int k = 0; k < 4; ++k) {
    const int point = PointOf(group, place, k);
    points[static_cast<std::size_t>(k)] = cache.Row(group, movement.weights, point).data();
  }
  kernels::BlendPoints(points.data(), place.weights.data(),
                       static_cast<std::size_t>(layout.row_floats), row);
}

/// Of a blended row's rotations that cancel each other, takes those of the largest example: it is at least a pose.
void TakeLargest(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                 const GridPlace& place, float* row);

}  // namespace stridewire
