#pragma once

#include <cstddef>

namespace stridewire::client {

/// Rotations of four poses, each [joint] x y z w, and the weights of cubic interpolation.
struct RotationKeys {
  const float* before;
  const float* start;
  const float* end;
  const float* beyond;
  bool start_slope_is_before;  ///< The slope at start is start - before instead of end - before.
  float value;                 ///< Weight of end - start.
  float start_slope;           ///< Weight of the slope at start.
  float end_slope;             ///< Weight of beyond - start.
};

/// Interpolates `count` rotations in one hemisphere, normalizes them and writes them to `out`,
/// [joint] x y z w. The bytes do not depend on the vector width of the machine (Google Highway).
void InterpolateRotations(const RotationKeys& keys, std::size_t count, float* out);

}  // namespace stridewire::client
