#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace stridewire::builtin {

/// Sideways detours that a swinging foot may take around the other foot. All members must be above
/// 0.
struct DetourRange {
  double max_m = 0.0;        ///< Detours are shorter than this.
  double step_m = 0.0;       ///< Increment between successive detours that are tried.
  double clearance_m = 0.0;  ///< Minimum distance between the feet at which they do not touch.
};

/// Tolerance of distances between the feet. A longer detour is not taken if it gains less.
inline constexpr double kSmallestGainM = 1e-3;

/// Returns the smallest detour at which the feet stay `clearance_m` apart. If there is none,
/// returns the detour at which they stay farthest apart. `nearest_m` returns the smallest distance
/// between the feet for a detour.
template <class NearestM>
[[nodiscard]] double FindDetour(const DetourRange& range, const NearestM& nearest_m) {
  double best_m = 0.0;
  double widest_m = 0.0;
  for (double detour_m = 0.0; detour_m < range.max_m; detour_m += range.step_m) {
    const double distance_m = nearest_m(detour_m);
    // A longer detour must increase the distance noticeably. If the feet are closest at the
    // landing, no detour does, because detours do not change the landing.
    if (distance_m <= widest_m + kSmallestGainM) continue;
    widest_m = distance_m;
    best_m = detour_m;
    if (widest_m >= range.clearance_m) break;
  }
  return best_m;
}

/// Same as FindDetour, but refines the result by bisection. The result therefore need not be a
/// multiple of `step_m`, and rounding errors of distances hardly change it. The feet may be
/// kSmallestGainM closer than `clearance_m`, or than the largest distance found if `clearance_m` is
/// out of reach.
template <class NearestM>
[[nodiscard]] double FindExactDetour(const DetourRange& range, const NearestM& nearest_m) {
  constexpr int kBisections = 14;
  std::vector<double> distances_m;
  double widest_m = 0.0;
  for (double detour_m = 0.0; detour_m < range.max_m && widest_m < range.clearance_m;
       detour_m += range.step_m) {
    distances_m.push_back(nearest_m(detour_m));
    widest_m = std::max(widest_m, distances_m.back());
  }
  const double enough_m = std::min(widest_m, range.clearance_m) - kSmallestGainM;
  std::size_t first = 0;
  while (distances_m[first] < enough_m) ++first;
  if (first == 0) return 0.0;
  double longer_m = static_cast<double>(first) * range.step_m;
  double shorter_m = longer_m - range.step_m;
  for (int i = 0; i < kBisections; ++i) {
    const double middle_m = 0.5 * (shorter_m + longer_m);
    (nearest_m(middle_m) < enough_m ? shorter_m : longer_m) = middle_m;
  }
  return longer_m;
}

}  // namespace stridewire::builtin
