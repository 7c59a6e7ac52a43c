#pragma once

namespace stridewire::builtin {

/// exp and tanh, computed with correctly rounded operations only. Their results have the same bits
/// on every machine, while those of C libraries may differ in the last digit. For |x| <= 20, the
/// relative error of Exp and the absolute error of Tanh are below 1e-13.
[[nodiscard]] double Exp(double x);
[[nodiscard]] double Tanh(double x);

}  // namespace stridewire::builtin
