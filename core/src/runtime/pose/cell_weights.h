#pragma once

#include <array>

namespace stridewire {

/// Catmull-Rom weights of the grid points around a position in a grid. Points beyond the ends of
/// the grid are extrapolated quadratically. In a grid of two points, the weights are linear.
struct CellWeights {
  int first = 0;  ///< Grid point to which weights[0] belongs.
  int count = 0;  ///< Number of weights, 2 to 4.
  std::array<float, 4> weights{};
};

/// Returns the weights at `grid_position`, which is clamped to [0, point_count - 1]. `point_count`
/// is at least 2.
[[nodiscard]] CellWeights CellWeightsAt(double grid_position, int point_count);

}  // namespace stridewire
