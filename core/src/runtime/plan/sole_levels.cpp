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

// The Legendre polynomials on [0, 1] up to degree 4. Their weighted sum is added to a quartic.
using Values = std::array<double, 5>;
struct Basis {
  Values at{};         // Values of the polynomials at a sample.
  double scale = 0.0;  // Sum of the squares of these values.
};

constexpr auto kBasis = [] {
  std::array<Basis, kStanceSamples.size()> all;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const double x = 2.0 * kStanceSamples[i] - 1.0;
    const double x2 = x * x;
    all[i].at = {1.0, x, 1.5 * x2 - 0.5, (2.5 * x2 - 1.5) * x, (4.375 * x2 - 3.75) * x2 + 0.375};
    for (const double value : all[i].at) all[i].scale += value * value;
  }
  return all;
}();

}  // namespace

HeightRange LevellingRange(double above_m, double slack_m) {
  return {std::clamp(-kMaxSinkM - slack_m - above_m, -kMaxLevelM, kMaxLevelM),
          std::clamp(kMaxHoverM + slack_m - above_m, -kMaxLevelM, kMaxLevelM)};
}

double Levelling(double above_m) {
  const HeightRange range = LevellingRange(above_m);
  return std::clamp(0.0, range.min_m, range.max_m);
}

// Starts with the quartic that levels the sole at kLevelSamples. While the quartic is out of range
// at any sample, corrects it for one sample after the other, in at most kSweeps sweeps over all
// samples (Kaczmarz method).
Quartic LevellingQuartic(const std::array<double, kStanceSamples.size()>& above_m,
                         const std::array<HeightRange, kStanceSamples.size()>& ranges) {
  constexpr int kSweeps = 20;
  std::array<double, kLevelSamples.size()> values;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = Levelling(above_m[kLevelSamples[i]]);
  Quartic level = QuarticThrough(values);
  std::array<double, kStanceSamples.size()> levelled_m;
  for (std::size_t i = 0; i < levelled_m.size(); ++i) levelled_m[i] = level.At(kStanceSamples[i]);
  Values added{};
  // If a sweep finds all samples within their ranges, further sweeps change nothing.
  bool is_within = false;
  for (int sweep = 0; sweep < kSweeps && !is_within; ++sweep) {
    is_within = true;
    for (std::size_t i = 0; i < kStanceSamples.size(); ++i) {
      const auto& [at, scale] = kBasis[i];
      double height_m = levelled_m[i];
      for (std::size_t k = 0; k < at.size(); ++k) height_m += added[k] * at[k];
      const double lacking_m = std::clamp(height_m, ranges[i].min_m, ranges[i].max_m) - height_m;
      if (lacking_m == 0.0) continue;
      is_within = false;
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
