#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace stridewire {

// Standing soles may be this far above and below the ground, because the height of the sole is not
// known exactly from a capture. If the distance is larger, the height of the foot is corrected by
// up to kMaxLevelM. Larger differences are not errors of the blend.
inline constexpr double kMaxHoverM = 0.006;
inline constexpr double kMaxSinkM = 0.003;
inline constexpr double kMaxLevelM = 0.05;

// Fractions of the stance at which the standing foot is sampled, and the indices of those at which
// it is levelled. At the others it may be kStanceSlackM beyond the limits.
inline constexpr std::array<double, 16> kStanceSamples{
    0.0, 0.04, 0.1, 0.17, 0.25, 0.33, 0.42, 0.5, 0.58, 0.67, 0.75, 0.83, 0.9, 0.95, 0.98, 1.0};
inline constexpr std::array<std::size_t, 5> kLevelSamples{0, 4, 7, 10, 15};
inline constexpr double kStanceSlackM = 0.002;

/// A polynomial of degree 4 in the fraction of a movement.
struct Quartic {
  double constant = 0.0;
  std::array<double, 4> coefficients{};  ///< Of u, u^2, u^3 and u^4.

  [[nodiscard]] double At(double u) const {
    const auto& c = coefficients;
    return constant + u * (c[0] + u * (c[1] + u * (c[2] + u * c[3])));
  }
};

/// Range of heights to add to a sole.
struct HeightRange {
  double min_m = 0.0;
  double max_m = 0.0;
};

/// Returns by how much a sole may be raised that is `above_m` above the ground. Afterwards it may
/// be `slack_m` beyond the usual limits.
[[nodiscard]] HeightRange LevellingRange(double above_m, double slack_m = 0.0);

/// Returns by how much a sole has to be raised that is `above_m` above the ground.
[[nodiscard]] double Levelling(double above_m);

/// Returns heights that keep a sole on the ground during a stance. `above_m` are its heights above
/// the ground at kStanceSamples, and `ranges` the heights that may be added there.
[[nodiscard]] Quartic LevellingQuartic(
    const std::array<double, kStanceSamples.size()>& above_m,
    const std::array<HeightRange, kStanceSamples.size()>& ranges);

}  // namespace stridewire
