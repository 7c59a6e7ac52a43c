#pragma once

#include <cstddef>

namespace stridewire::client {

/// Rotations of four successive poses, each [joint] x y z w, and the weights with which they are
/// combined:
///
///   start + value (end - start) + start_slope (S - before) + end_slope (beyond - start)
///
/// The interval to interpolate is from `start` to `end`. S is `end`, or `start` if
/// `start_slope_is_before`.
struct RotationKeys {
  const float* before;
  const float* start;
  const float* end;
  const float* beyond;
  bool start_slope_is_before;  ///< True: S is `start`.
  float value;
  float start_slope;
  float end_slope;
};

/// Interpolates `count` rotations, after negating them where necessary so that they are in one
/// hemisphere. Normalizes the results and writes them to `out`, [joint] x y z w. The bytes do not
/// depend on the vector width of the machine.
void InterpolateRotations(const RotationKeys& keys, std::size_t count, float* out);

}  // namespace stridewire::client
