#include "offline/builtin/elementary.h"

namespace stridewire::builtin {

double Exp(double x) {
  // e^x = (e^(x/64))^64. The series converges fast for |x| <= 40, which includes the arguments 2x
  // of Tanh.
  const double y = x / 64.0;
  double sum = 1.0;
  for (int n = 14; n >= 1; --n) sum = 1.0 + sum * y / n;
  for (int i = 0; i < 6; ++i) sum *= sum;
  return sum;
}

double Tanh(double x) {
  const double e = Exp(2.0 * x);
  return (e - 1.0) / (e + 1.0);
}

}  // namespace stridewire::builtin
