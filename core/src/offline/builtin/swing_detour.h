#pragma once

namespace stridewire::builtin {

/// Sideways detours that a swinging foot may take around the other foot.
struct DetourRange {
  double max_m = 0.0;
  double step_m = 0.0;       ///< Increment between successive detours that are tried.
  double clearance_m = 0.0;  ///< Minimum distance between the feet at which they do not touch.
};

/// Returns the smallest detour at which the feet stay `clearance_m` apart. If there is none,
/// returns the detour at which they stay farthest apart. `nearest_m` returns the smallest distance
/// between the feet for a detour.
template <class NearestM>
[[nodiscard]] double FindDetour(const DetourRange& range, const NearestM& nearest_m) {
  constexpr double kSmallestGainM = 1e-3;
  double best_m = 0.0;
  double widest_m = 0.0;
  for (double detour_m = 0.0; detour_m < range.max_m; detour_m += range.step_m) {
    const double distance_m = nearest_m(detour_m);
    // A longer detour must increase the distance noticeably. It does not if the feet are closest at
    // the landing, which detours do not change.
    if (distance_m <= widest_m + kSmallestGainM) continue;
    widest_m = distance_m;
    best_m = detour_m;
    if (widest_m >= range.clearance_m) break;
  }
  return best_m;
}

}  // namespace stridewire::builtin
