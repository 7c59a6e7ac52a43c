#pragma once

#include <span>
#include <string>
#include <vector>

#include "stridewire/offline/raw_library.h"

namespace stridewire {

// An example resampled on its group's generic-time grid; rows as GridLayout has them.
struct GridExample {
  std::vector<float> rows;  // [grid point][row_floats]
  std::vector<double> keytimes_s;
  std::vector<double> parameters;
  double heading_change_rad = 0.0;
  std::string source;
  bool mirrored = false;
};

// Samples the example at the times its own warp gives the grid points.
[[nodiscard]] GridExample ResampleOnGrid(const RawExample& example, std::span<const int> cells,
                                         const GridLayout& layout);

// Makes each joint's track continuous in sign, then flips whole tracks into the hemisphere of one example (the one
// nearest to the mean parameters). Point by point, one that turns half a turn away from it would jump, and with it the
// blend that is interpolated between points. The reference must not depend on the weights, for the same reason.
void AlignHemispheres(std::vector<GridExample>& examples, const GridLayout& layout,
                      int joint_count);

// Sets a row to a weighted sum of rows, rotations made unit. One whose rotations cancel each other stays as it was.
void SetBlendedRow(std::span<const float> sum, const GridLayout& layout, float* row);

// Pose of a row: root position and yaw put back together.
[[nodiscard]] Pose PoseOfRow(std::span<const float> row, const GridLayout& layout, int joint_count);

}  // namespace stridewire
