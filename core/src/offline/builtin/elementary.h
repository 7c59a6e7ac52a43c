#pragma once

namespace stridewire::builtin {

/// exp, x^y and tanh made of exact operations, for the same bytes on every machine (C libraries
/// differ in the last place). Relative error below 1e-13 for |x| <= 20.
[[nodiscard]] double Exp(double x);
[[nodiscard]] double Power(double base, double exponent);  ///< base > 0
[[nodiscard]] double Tanh(double x);

/// 0 at and below 0, 1 at and above 1, between them 3x^2 - 2x^3.
[[nodiscard]] double Ease(double x);

}  // namespace stridewire::builtin
