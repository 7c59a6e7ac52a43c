#pragma once

namespace stridewire::builtin {

/// exp and tanh, computed with exactly rounded operations only. They give the same bits on every
/// machine, unlike those of C libraries, which differ in the last digit. The relative error is
/// below 1e-13 for |x| <= 20.
[[nodiscard]] double Exp(double x);
[[nodiscard]] double Tanh(double x);

}  // namespace stridewire::builtin
