#pragma once

#include <span>
#include <string>
#include <vector>

#include "stridewire/offline/raw_library.h"

namespace stridewire {

// An example that was resampled on the generic-time grid of its group. GridLayout defines the rows.
struct GridExample {
  std::vector<float> rows;  // [grid point][row_floats]
  std::vector<double> keytimes_s;
  std::vector<double> parameters;
  double heading_change_rad = 0.0;
  std::string source;
  bool mirrored = false;
};

// Samples the clip of an example. At the time of a frame, returns that frame without any change.
void SampleExample(const RawExample& example, double time_s, PoseSpan out);

// Samples an example at the grid points, using its own keytimes. `stand_root` is the rotation of
// the root in the stand pose, in which the heading is 0. Headings are measured relative to it,
// because the axes of the root's frame differ between skeletons.
[[nodiscard]] GridExample ResampleOnGrid(const RawExample& example, std::span<const int> cells,
                                         const GridLayout& layout, const Quat& stand_root);

// Same, but samples the example at `times_s` [grid point].
[[nodiscard]] GridExample ResampleAt(const RawExample& example, std::span<const double> times_s,
                                     const GridLayout& layout, const Quat& stand_root);

// Makes the quaternions of each joint continuous in sign over time. Then negates whole tracks,
// where necessary, so that they are in the hemisphere of a reference: the example nearest to the
// mean parameters. If single points were negated instead, tracks that rotate by 180 degrees away
// from the reference would jump, and with them the interpolated blend. A reference that depends on
// the weights would have the same effect.
void AlignHemispheres(std::vector<GridExample>& examples, const GridLayout& layout,
                      int joint_count);

// Negates whole tracks of an example, where necessary, so that they are in the same hemisphere as
// those of `reference`. The tracks of both must be continuous in sign.
void AlignHemisphere(const GridExample& reference, const GridLayout& layout, int joint_count,
                     GridExample& example);

// Sets `row` to `sum`, a weighted sum of rows, and normalises its rotations. If the rotations of a
// joint cancel each other out in the sum, `row` keeps its previous rotation of that joint.
void SetBlendedRow(std::span<const float> sum, const GridLayout& layout, float* row);

// Converts a row to a pose, with root position and yaw applied.
[[nodiscard]] Pose PoseOfRow(std::span<const float> row, const GridLayout& layout, int joint_count);

}  // namespace stridewire
