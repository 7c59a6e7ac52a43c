#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace stridewire {

// Standing soles may be up to kMaxHoverM above and kMaxSinkM below the ground, because captures do
// not determine the height of the sole exactly. Beyond these limits, the height of the foot is
// corrected by up to kMaxLevelM.
inline constexpr double kMaxHoverM = 0.006;
inline constexpr double kMaxSinkM = 0.003;
inline constexpr double kMaxLevelM = 0.05;

// kStanceSamples are fractions of the stance at which a standing foot is sampled. LevellingQuartic
// starts with a curve that keeps the sole within these limits at the samples with the indices
// kLevelSamples. It then corrects samples at which the sole exceeds the limits by more than
// kStanceSlackM.
inline constexpr std::array<double, 16> kStanceSamples{
    0.0, 0.04, 0.1, 0.17, 0.25, 0.33, 0.42, 0.5, 0.58, 0.67, 0.75, 0.83, 0.9, 0.95, 0.98, 1.0};
inline constexpr std::array<std::size_t, 5> kLevelSamples{0, 4, 7, 10, 15};
inline constexpr double kStanceSlackM = 0.002;

/// A polynomial of degree 4 in the elapsed fraction of a movement.
struct Quartic {
  double constant = 0.0;
  std::array<double, 4> coefficients{};  ///< Of u, u^2, u^3 and u^4.

  [[nodiscard]] double At(double u) const {
    const auto& c = coefficients;
    return constant + u * (c[0] + u * (c[1] + u * (c[2] + u * c[3])));
  }
};

/// Range of heights that may be added to a sole.
struct HeightRange {
  double min_m = 0.0;
  double max_m = 0.0;
};

/// Returns the range of heights by which a sole that is `above_m` above the ground may be raised,
/// so that it exceeds kMaxHoverM or kMaxSinkM by at most `slack_m`. Negative heights lower the
/// sole. Both ends of the range are limited to kMaxLevelM in either direction.
[[nodiscard]] HeightRange LevellingRange(double above_m, double slack_m = 0.0);

/// Returns by how much a sole that is `above_m` above the ground must be raised to be within the
/// limits, at most kMaxLevelM. Negative if it must be lowered, 0 if it is within the limits
/// already.
[[nodiscard]] double Levelling(double above_m);

/// Returns a curve over a stance which, if it is added to the height of the foot, keeps the sole on
/// the ground. `above_m` contains the heights of the sole above the ground at kStanceSamples,
/// without the curve. `ranges` limits the curve at these samples.
[[nodiscard]] Quartic LevellingQuartic(
    const std::array<double, kStanceSamples.size()>& above_m,
    const std::array<HeightRange, kStanceSamples.size()>& ranges);

}  // namespace stridewire
