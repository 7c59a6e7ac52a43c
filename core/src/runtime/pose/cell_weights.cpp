#include "runtime/pose/cell_weights.h"

#include <algorithm>

namespace stridewire {

CellWeights CellWeightsAt(double grid_position, int point_count) {
  const int cell = std::clamp(static_cast<int>(grid_position), 0, point_count - 2);
  const double f = std::clamp(grid_position - cell, 0.0, 1.0);
  if (point_count == 2) return {0, 2, {static_cast<float>(1.0 - f), static_cast<float>(f), 0, 0}};
  const double before = f * (-0.5 + f * (1.0 - 0.5 * f));
  const double left = 1.0 + f * f * (-2.5 + 1.5 * f);
  const double right = f * (0.5 + f * (2.0 - 1.5 * f));
  const double after = f * f * (-0.5 + 0.5 * f);
  // Beyond an end, a missing neighbour is extrapolated as p_-1 = 3 p_0 - 3 p_1 + p_2. The tangent
  // at the end is then the one-sided second-order difference.
  if (cell == 0) {
    return {0,
            3,
            {static_cast<float>(left + 3.0 * before), static_cast<float>(right - 3.0 * before),
             static_cast<float>(after + before), 0.0f}};
  }
  if (cell == point_count - 2) {
    return {cell - 1,
            3,
            {static_cast<float>(before + after), static_cast<float>(left - 3.0 * after),
             static_cast<float>(right + 3.0 * after), 0.0f}};
  }
  return {cell - 1,
          4,
          {static_cast<float>(before), static_cast<float>(left), static_cast<float>(right),
           static_cast<float>(after)}};
}

}  // namespace stridewire
