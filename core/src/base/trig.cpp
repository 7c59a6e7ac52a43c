#include "base/trig.h"

#include <cmath>
#include <numbers>

namespace stridewire {
namespace {

constexpr double kPi = std::numbers::pi;

// pi/2 split into three constants (Cody and Waite). The first two have trailing zero bits, so that
// k times each of them is exact for |k| < 2^20 and the reduced argument keeps full precision.
constexpr double kHalfPi1 = 1.57079632673412561417e+00;
constexpr double kHalfPi2 = 6.07710050630396597660e-11;
constexpr double kHalfPi3 = 2.02226624879595063154e-21;

// Taylor polynomials. On |x| <= pi/4 the first omitted term is below 1e-17.
double SinNearZero(double x) {
  const double s = x * x;
  double p = 1.0 / 355687428096000.0;
  p = p * s - 1.0 / 1307674368000.0;
  p = p * s + 1.0 / 6227020800.0;
  p = p * s - 1.0 / 39916800.0;
  p = p * s + 1.0 / 362880.0;
  p = p * s - 1.0 / 5040.0;
  p = p * s + 1.0 / 120.0;
  p = p * s - 1.0 / 6.0;
  return x + x * s * p;
}

double CosNearZero(double x) {
  const double s = x * x;
  double p = 1.0 / 20922789888000.0;
  p = p * s - 1.0 / 87178291200.0;
  p = p * s + 1.0 / 479001600.0;
  p = p * s - 1.0 / 3628800.0;
  p = p * s + 1.0 / 40320.0;
  p = p * s - 1.0 / 720.0;
  p = p * s + 1.0 / 24.0;
  return 1.0 - 0.5 * s + s * s * p;
}

struct Reduced {
  double x;      // in [-pi/4, pi/4]
  int quadrant;  // 0..3
};

Reduced Reduce(double x) {
  const double k = std::nearbyint(x * (2.0 / kPi));
  const double r = ((x - k * kHalfPi1) - k * kHalfPi2) - k * kHalfPi3;
  return {r, static_cast<int>(static_cast<long long>(k) & 3)};
}

// atan on [0, 1]. Halving the angle three times brings x below 0.0985, where a short series is
// accurate enough.
double AtanUnit(double x) {
  double scale = 1.0;
  for (int i = 0; i < 3; ++i) {
    x = x / (1.0 + std::sqrt(1.0 + x * x));
    scale *= 2.0;
  }
  const double s = x * x;
  double p = 1.0 / 17.0;
  p = 1.0 / 15.0 - p * s;
  p = 1.0 / 13.0 - p * s;
  p = 1.0 / 11.0 - p * s;
  p = 1.0 / 9.0 - p * s;
  p = 1.0 / 7.0 - p * s;
  p = 1.0 / 5.0 - p * s;
  p = 1.0 / 3.0 - p * s;
  return scale * (x - x * s * p);
}

}  // namespace

double Sin(double x_rad) {
  const Reduced r = Reduce(x_rad);
  switch (r.quadrant) {
    case 0: return SinNearZero(r.x);
    case 1: return CosNearZero(r.x);
    case 2: return -SinNearZero(r.x);
    default: return -CosNearZero(r.x);
  }
}

double Cos(double x_rad) {
  const Reduced r = Reduce(x_rad);
  switch (r.quadrant) {
    case 0: return CosNearZero(r.x);
    case 1: return -SinNearZero(r.x);
    case 2: return -CosNearZero(r.x);
    default: return SinNearZero(r.x);
  }
}

double Atan2(double y, double x) {
  const double ax = std::fabs(x);
  const double ay = std::fabs(y);
  if (ax == 0.0 && ay == 0.0) return 0.0;
  double angle = ay <= ax ? AtanUnit(ay / ax) : 0.5 * kPi - AtanUnit(ax / ay);
  if (x < 0.0) angle = kPi - angle;
  return y < 0.0 ? -angle : angle;
}

double Acos(double x) {
  if (x >= 1.0) return 0.0;
  if (x <= -1.0) return kPi;
  return Atan2(std::sqrt((1.0 - x) * (1.0 + x)), x);
}

}  // namespace stridewire
