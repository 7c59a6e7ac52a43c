#pragma once

#include <array>
#include <span>
#include <vector>

#include "stridewire/base/error.h"

namespace stridewire {

inline constexpr int kMaxIntervals = 8;  ///< Maximum number of keytime intervals per movement.
/// Minimum length of a keytime interval in seconds. A library with a shorter interval is rejected.
inline constexpr double kMinIntervalS = 1e-3;

/// Checks the keytimes of a movement. Fails with kOutOfRange if there are fewer than 2 or more than
/// kMaxIntervals + 1 keytimes, the first is not 0, an interval is shorter than kMinIntervalS
/// (Error::index is the interval), or a number is not finite.
[[nodiscard]] Status ValidateKeytimes(std::span<const double> keytimes_s);

/// Generic time, paper Eq. (3): g(t) = i + (t - K_i) / (K_{i+1} - K_i) for K_i <= t < K_{i+1}. t is
/// clamped to [K_0, K_n], so g(K_n) = n, which Eq. (3) leaves undefined. If there are empty
/// intervals, the last i with K_i <= t is used.
[[nodiscard]] double GenericTime(std::span<const double> keytimes_s, double time_s);

/// The inverse of GenericTime. `generic_time` is clamped to [0, n].
[[nodiscard]] double TimeAtGenericTime(std::span<const double> keytimes_s, double generic_time);

/// A blended interval is clamped to these multiples of the weighted mean of that interval over the
/// examples with positive weights.
inline constexpr double kShortestInterval = 0.75;
inline constexpr double kLongestInterval = 4.0 / 3.0;

/// Blends keytimes (paper, Eq. (4)). Blends the *lengths* of intervals and clamps each length to
/// kShortestInterval and kLongestInterval, because weights may be negative. Without the clamp, the
/// keytimes sum w K would not always increase outside the hull. Even inside the hull, an interval
/// could shrink much more than the motion in it, which would then be too fast.
///
/// `example_keytimes_s` is [example][interval_count + 1] and `out_s` is [interval_count + 1]. The
/// weights must sum to 1, and K_0 = 0.
void BlendKeytimes(std::span<const double> example_keytimes_s, std::span<const float> weights,
                   std::span<double> out_s);

/// Smooth map between time and grid position: the monotone cubic (PCHIP, Fritsch and Carlson 1980)
/// through (K_i, u_i). The velocity of the piecewise linear map of Eq. (3) jumps at keytimes. The
/// cubic map is C1, maps keytimes to the same positions, and deviates from the linear map by at
/// most a few ms between them.
///
///   u_i = sum of the cells of the intervals before i; generic time g = i + (u - u_i) / cells_i
class TimeWarp {
 public:
  TimeWarp() = default;
  /// `keytimes_s` must increase; `cells` has one positive count per interval.
  TimeWarp(std::span<const double> keytimes_s, std::span<const int> cells);

  /// Returns the grid position in [0, number of cells] at `time_s`, clamped to the movement.
  [[nodiscard]] double GridPosition(double time_s) const;
  /// Inverts GridPosition, by bisection to 1e-12 s. Too slow for use in every tick.
  [[nodiscard]] double TimeAt(double grid_position) const;
  /// Returns the generic time at `time_s`: GridPosition, converted to keytime intervals.
  [[nodiscard]] double GenericTimeAt(double time_s) const;

  [[nodiscard]] int interval_count() const { return interval_count_; }
  [[nodiscard]] double keytime_s(int i) const { return knots_[static_cast<std::size_t>(i)].time_s; }
  [[nodiscard]] std::vector<double> Keytimes() const;
  [[nodiscard]] double duration_s() const { return keytime_s(interval_count_); }

  /// A segment of the map, between two successive keytimes.
  struct Piece {
    double begin_s, end_s;          ///< Keytimes at both ends.
    double begin, end;              ///< Grid positions at both ends.
    double begin_slope, end_slope;  ///< Grid positions per second at both ends.
  };
  /// Returns the segment that contains `time_s`, or the first or last segment for times outside the
  /// movement.
  [[nodiscard]] Piece PieceAt(double time_s) const {
    std::size_t i = 0;
    for (int k = 1; k < interval_count_; ++k) {
      i += time_s >= keytime_s(k) ? 1 : 0;
    }
    const Knot& begin = knots_[i];
    const Knot& end = knots_[i + 1];
    return {begin.time_s, end.time_s, begin.position, end.position, begin.slope, end.slope};
  }

 private:
  // The numbers of a knot are stored together, so that a tick reads few cache lines.
  struct Knot {
    double time_s = 0.0;
    double position = 0.0;
    double slope = 0.0;  // du/dt
  };
  int interval_count_ = 0;
  std::array<Knot, kMaxIntervals + 1> knots_{};
};

}  // namespace stridewire
