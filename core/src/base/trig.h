#pragma once

namespace stridewire {

/// Trigonometry made of additions, multiplications, divisions and square roots alone.
///
/// C libraries differ by an ulp in sin, cos, acos and atan2; these give the same bits on every
/// machine, which everything that evaluates a movement relies on. Errors stay below 1e-15 absolute
/// for |x| <= 1e5 (angles in radians); a test compares them with the C library.
[[nodiscard]] double Sin(double x_rad);
[[nodiscard]] double Cos(double x_rad);

/// Angle of (x, y) in (-pi, pi]; 0 for (0, 0).
[[nodiscard]] double Atan2(double y, double x);

/// acos(x) in [0, pi]; x is clamped to [-1, 1] first.
[[nodiscard]] double Acos(double x);

}  // namespace stridewire
