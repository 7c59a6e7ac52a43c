#pragma once

namespace stridewire {

/// Trigonometry that uses only additions, multiplications, divisions and square roots.
///
/// The C libraries of different systems differ in the last bit of sin, cos, acos and atan2. These
/// functions return the same bits on every machine, so that poses are the same everywhere. For
/// |x| <= 1e5 the absolute error is below 1e-15 (angles in radians). A test compares them with the
/// C library.
[[nodiscard]] double Sin(double x_rad);
[[nodiscard]] double Cos(double x_rad);

/// Angle of the vector (x, y) in [-pi, pi]. Returns 0 for (0, 0).
[[nodiscard]] double Atan2(double y, double x);

/// acos(x) in [0, pi]. An x outside [-1, 1] is clamped to that range.
[[nodiscard]] double Acos(double x);

}  // namespace stridewire
