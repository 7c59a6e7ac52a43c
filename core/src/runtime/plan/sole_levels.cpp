#include "runtime/plan/sole_levels.h"

namespace stridewire {
namespace {

// Returns the quartic with these values at kLevelSamples, computed by Newton's forward differences.
Quartic QuarticThrough(std::array<double, kLevelSamples.size()> values) {
  const double constant = values[0];
  std::array<double, 4> d{};
  for (std::size_t order = 0; order < d.size(); ++order) {
    for (std::size_t i = 0; i + order < d.size(); ++i) values[i] = values[i + 1] - values[i];
    d[order] = values[0];
  }
  return {constant,
          {4.0 * (d[0] - d[1] / 2.0 + d[2] / 3.0 - d[3] / 4.0),
           16.0 * (d[1] / 2.0 - d[2] / 2.0 + 11.0 * d[3] / 24.0), 64.0 * (d[2] / 6.0 - d[3] / 4.0),
           256.0 * d[3] / 24.0}};
}

}  // namespace

HeightRange LevellingRange(double above_m, double slack_m) {
  return {std::clamp(-kMaxSinkM - slack_m - above_m, -kMaxLevelM, kMaxLevelM),
          std::clamp(kMaxHoverM + slack_m - above_m, -kMaxLevelM, kMaxLevelM)};
}

double Levelling(double above_m) {
  const HeightRange range = LevellingRange(above_m);
  return std::clamp(0.0, range.min_m, range.max_m);
}

// The quartic levels the sole at five samples. If it is out of range at other samples, it is
// projected onto one range after the other (Kaczmarz).
Quartic LevellingQuartic(const std::array<double, kStanceSamples.size()>& above_m,
                         const std::array<HeightRange, kStanceSamples.size()>& ranges) {
  constexpr int kSweeps = 20;
  std::array<double, kLevelSamples.size()> values;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = Levelling(above_m[kLevelSamples[i]]);
  Quartic level = QuarticThrough(values);
  // The added heights are a sum of the Legendre polynomials on [0, 1].
  using Values = std::array<double, 5>;
  Values added{};
  const auto basis = [](double u) -> Values {
    const double x = 2.0 * u - 1.0;
    const double x2 = x * x;
    return {1.0, x, 1.5 * x2 - 0.5, (2.5 * x2 - 1.5) * x, (4.375 * x2 - 3.75) * x2 + 0.375};
  };
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (std::size_t i = 0; i < kStanceSamples.size(); ++i) {
      const Values at = basis(kStanceSamples[i]);
      double height_m = level.At(kStanceSamples[i]);
      double scale = 0.0;
      for (std::size_t k = 0; k < at.size(); ++k) {
        height_m += added[k] * at[k];
        scale += at[k] * at[k];
      }
      const double lacking_m = std::clamp(height_m, ranges[i].min_m, ranges[i].max_m) - height_m;
      for (std::size_t k = 0; k < at.size(); ++k) added[k] += lacking_m / scale * at[k];
    }
  }
  level.constant += added[0] - added[1] + added[2] - added[3] + added[4];
  auto& c = level.coefficients;
  c[0] += 2.0 * added[1] - 6.0 * added[2] + 12.0 * added[3] - 20.0 * added[4];
  c[1] += 6.0 * added[2] - 30.0 * added[3] + 90.0 * added[4];
  c[2] += 20.0 * added[3] - 140.0 * added[4];
  c[3] += 70.0 * added[4];
  return level;
}

}  // namespace stridewire
