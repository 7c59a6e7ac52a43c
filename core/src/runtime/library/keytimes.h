#pragma once

#include <array>
#include <span>
#include <vector>

#include "stridewire/base/error.h"

namespace stridewire {

inline constexpr int kMaxIntervals = 8;        ///< Most keytime intervals of a movement.
inline constexpr double kMinIntervalS = 1e-3;  ///< Shorter intervals are rejected at load.

/// kOutOfRange: fewer than 2 or more than kMaxIntervals + 1 keytimes, first not 0, an interval
/// shorter than kMinIntervalS (index: the interval), a number not finite.
[[nodiscard]] Status ValidateKeytimes(std::span<const double> keytimes_s);

/// Generic time, paper Eq. (3): g(t) = i + (t - K_i) / (K_{i+1} - K_i) for K_i <= t < K_{i+1}.
/// t is clamped to [K_0, K_n], so g(K_n) = n (Eq. (3) leaves it out). Of empty intervals the last i
/// with K_i <= t wins.
[[nodiscard]] double GenericTime(std::span<const double> keytimes_s, double time_s);

/// Inverse of GenericTime; `generic_time` is clamped to [0, n].
[[nodiscard]] double TimeAtGenericTime(std::span<const double> keytimes_s, double generic_time);

/// A blended interval stays within these multiples of the mean of that interval over the examples of
/// positive weight.
inline constexpr double kShortestInterval = 0.75;
inline constexpr double kLongestInterval = 4.0 / 3.0;

/// Blended keytimes, paper Eq. (4), with what negative weights demand: interval *lengths* are
/// blended and each is clamped as above. Otherwise sum w K stops increasing outside the hull, and
/// even inside it an interval may shrink much faster than the motion in it, which then rushes: on
/// steps of 0.64 to 0.76 m of captured subject 16 by 2.7 cm from one 60 Hz frame to the next. K_0 = 0.
/// `example_keytimes_s` is [example][interval_count + 1]; `out_s` holds interval_count + 1; the
/// weights sum to 1.
void BlendKeytimes(std::span<const double> example_keytimes_s, std::span<const float> weights,
                   std::span<double> out_s);

/// Smooth map between time and grid position: the monotone cubic (PCHIP, Fritsch and Carlson 1980)
/// through (K_i, u_i). The piecewise linear map of Eq. (3) steps in velocity at keytimes; this one
/// is C1, moves no keytime, and deviates by at most a few ms between them.
///
///   u_i = sum of the cells of the intervals before i; generic time g = i + (u - u_i) / cells_i
class TimeWarp {
 public:
  TimeWarp() = default;
  /// `keytimes_s` increasing; `cells` one positive count an interval.
  TimeWarp(std::span<const double> keytimes_s, std::span<const int> cells);

  /// Grid position u in [0, cell_count] at `time_s` (clamped).
  [[nodiscard]] double GridPosition(double time_s) const;
  /// Inverse, by bisection to 1e-12 s: for building, not for the tick.
  [[nodiscard]] double TimeAt(double grid_position) const;
  /// Generic time at `time_s`: GridPosition expressed in keytime intervals.
  [[nodiscard]] double GenericTimeAt(double time_s) const;

  [[nodiscard]] int interval_count() const { return interval_count_; }
  [[nodiscard]] double keytime_s(int i) const { return knots_[static_cast<std::size_t>(i)].time_s; }
  [[nodiscard]] std::vector<double> Keytimes() const;
  [[nodiscard]] double duration_s() const { return keytime_s(interval_count_); }

  /// The piece of the map between two keytimes.
  struct Piece {
    double begin_s, end_s;          ///< Keytimes
    double begin, end;              ///< Grid positions there
    double begin_slope, end_slope;  ///< Grid positions a second
  };
  /// The one `time_s` lies in, the first or the last for times outside.
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
  // Together, so that a tick finds them in few lines of memory.
  struct Knot {
    double time_s = 0.0;
    double position = 0.0;
    double slope = 0.0;  // du/dt
  };
  int interval_count_ = 0;
  std::array<Knot, kMaxIntervals + 1> knots_{};
};

}  // namespace stridewire
