#pragma once

#include <array>

namespace stridewire {

/// Catmull-Rom weights of the grid points around a position in a grid, ends by quadratic extrapolation.
struct CellWeights {
  int first = 0;  ///< Grid point of weights[0]
  int count = 0;  ///< 2 to 4
  std::array<float, 4> weights{};
};

/// `grid_position` in [0, point_count - 1], clamped; at least two points.
[[nodiscard]] CellWeights CellWeightsAt(double grid_position, int point_count);

}  // namespace stridewire
