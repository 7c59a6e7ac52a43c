#include "offline/builtin/elementary.h"

namespace stridewire::builtin {
namespace {

constexpr double kLn2 = 0.69314718055994530942;

// Returns ln x for x = m 2^k with m in [0.75, 1.5), using ln m = 2 artanh((m - 1) / (m + 1)).
double Log(double x) {
  int k = 0;
  while (x >= 1.5) {
    x *= 0.5;
    ++k;
  }
  while (x < 0.75) {
    x *= 2.0;
    --k;
  }
  const double r = (x - 1.0) / (x + 1.0);
  const double s = r * r;
  double sum = 0.0;
  for (int n = 25; n >= 1; n -= 2) sum = sum * s + 1.0 / n;
  return 2.0 * r * sum + k * kLn2;
}

}  // namespace

double Exp(double x) {
  // e^x = (e^(x/64))^64; the series converges fast for |x| <= 20/64.
  const double y = x / 64.0;
  double sum = 1.0;
  for (int n = 14; n >= 1; --n) sum = 1.0 + sum * y / n;
  for (int i = 0; i < 6; ++i) sum *= sum;
  return sum;
}

double Power(double base, double exponent) { return Exp(exponent * Log(base)); }

double Tanh(double x) {
  const double e = Exp(2.0 * x);
  return (e - 1.0) / (e + 1.0);
}

double Ease(double x) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  return x * x * (3.0 - 2.0 * x);
}

}  // namespace stridewire::builtin
