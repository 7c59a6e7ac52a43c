#include "runtime/library/keytimes.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace stridewire {
namespace {

int LastInterval(std::span<const double> keytimes_s) {
  return static_cast<int>(keytimes_s.size()) - 2;
}

double At(std::span<const double> values, int i) { return values[static_cast<std::size_t>(i)]; }

}  // namespace

Status ValidateKeytimes(std::span<const double> keytimes_s) {
  const int count = static_cast<int>(keytimes_s.size());
  if (count < 2)
    return Fail(ErrorCode::kOutOfRange, "a movement needs at least two keytimes", count);
  if (count > kMaxIntervals + 1) return Fail(ErrorCode::kOutOfRange, "too many keytimes", count);
  if (keytimes_s[0] != 0.0) return Fail(ErrorCode::kOutOfRange, "the first keytime must be 0");
  for (int i = 0; i + 1 < count; ++i) {
    const double length_s = At(keytimes_s, i + 1) - At(keytimes_s, i);
    if (!std::isfinite(length_s)) {
      return Fail(ErrorCode::kOutOfRange, "a keytime is not finite", i + 1);
    }
    if (length_s < kMinIntervalS) {
      return Fail(ErrorCode::kOutOfRange, "a keytime interval is shorter than 1 ms", i);
    }
  }
  return {};
}

double GenericTime(std::span<const double> keytimes_s, double time_s) {
  const int last = LastInterval(keytimes_s);
  const double t = std::clamp(time_s, keytimes_s.front(), keytimes_s.back());
  int i = last;
  while (i > 0 && t < At(keytimes_s, i)) --i;
  const double length_s = At(keytimes_s, i + 1) - At(keytimes_s, i);
  return length_s > 0.0 ? i + (t - At(keytimes_s, i)) / length_s : i;
}

double TimeAtGenericTime(std::span<const double> keytimes_s, double generic_time) {
  const int last = LastInterval(keytimes_s);
  const double g = std::clamp(generic_time, 0.0, last + 1.0);
  const int i = std::min(static_cast<int>(g), last);
  return At(keytimes_s, i) + (g - i) * (At(keytimes_s, i + 1) - At(keytimes_s, i));
}

void BlendKeytimes(std::span<const double> example_keytimes_s, std::span<const float> weights,
                   std::span<double> out_s) {
  const std::size_t key_count = out_s.size();
  out_s[0] = 0.0;
  for (std::size_t i = 0; i + 1 < key_count; ++i) {
    double blended = 0.0;
    double positive = 0.0;
    double positive_weight = 0.0;
    for (std::size_t e = 0; e < weights.size(); ++e) {
      const double* keys = &example_keytimes_s[e * key_count];
      const double weight = static_cast<double>(weights[e]);
      const double length_s = keys[i + 1] - keys[i];
      blended += weight * length_s;
      if (weight > 0.0) {
        positive += weight * length_s;
        positive_weight += weight;
      }
    }
    const double typical_s = positive / positive_weight;
    out_s[i + 1] =
        out_s[i] + std::clamp(blended, kShortestInterval * typical_s, kLongestInterval * typical_s);
  }
}

TimeWarp::TimeWarp(std::span<const double> keytimes_s, std::span<const int> cells)
    : interval_count_(static_cast<int>(cells.size())) {
  const std::size_t n = cells.size();
  STRIDEWIRE_CHECK(n >= 1 && n <= static_cast<std::size_t>(kMaxIntervals));
  STRIDEWIRE_CHECK(keytimes_s.size() == n + 1);
  std::array<double, kMaxIntervals> length{};
  std::array<double, kMaxIntervals> rate{};  // Cells per second in each interval.
  knots_[0].time_s = keytimes_s[0];
  for (std::size_t i = 0; i < n; ++i) {
    knots_[i + 1].time_s = keytimes_s[i + 1];
    knots_[i + 1].position = knots_[i].position + cells[i];
    length[i] = keytimes_s[i + 1] - keytimes_s[i];
    rate[i] = cells[i] / length[i];
  }
  // Fritsch and Carlson: the cubic is monotone if its slopes are weighted harmonic means of the
  // neighbouring rates. All rates are positive here. The slopes at the ends use the one-sided
  // three-point formula, clamped to [0, 3 rate], which guarantees monotonicity.
  if (n == 1) {
    knots_[0].slope = knots_[1].slope = rate[0];
    return;
  }
  for (std::size_t i = 1; i < n; ++i) {
    const double w1 = 2.0 * length[i] + length[i - 1];
    const double w2 = length[i] + 2.0 * length[i - 1];
    knots_[i].slope = (w1 + w2) / (w1 / rate[i - 1] + w2 / rate[i]);
  }
  const auto end_slope = [](double h0, double h1, double r0, double r1) {
    return std::clamp(((2.0 * h0 + h1) * r0 - h0 * r1) / (h0 + h1), 0.0, 3.0 * r0);
  };
  knots_[0].slope = end_slope(length[0], length[1], rate[0], rate[1]);
  knots_[n].slope = end_slope(length[n - 1], length[n - 2], rate[n - 1], rate[n - 2]);
}

std::vector<double> TimeWarp::Keytimes() const {
  std::vector<double> keytimes_s;
  for (int i = 0; i <= interval_count_; ++i) keytimes_s.push_back(keytime_s(i));
  return keytimes_s;
}

double TimeWarp::GridPosition(double time_s) const {
  const Piece piece = PieceAt(time_s);
  if (!(time_s > piece.begin_s)) return piece.begin;
  if (time_s >= piece.end_s) return piece.end;
  const double h = piece.end_s - piece.begin_s;
  const double s = (time_s - piece.begin_s) / h;
  const double rise = piece.end - piece.begin;
  // Cubic Hermite interpolation, relative to the start of the piece so that short times after it
  // remain precise.
  const double m0 = piece.begin_slope * h;
  const double m1 = piece.end_slope * h;
  const double value =
      piece.begin + s * (m0 + s * ((3.0 * rise - 2.0 * m0 - m1) + s * (m0 + m1 - 2.0 * rise)));
  return std::clamp(value, piece.begin, piece.end);
}

double TimeWarp::TimeAt(double grid_position) const {
  const auto n = static_cast<std::size_t>(interval_count_);
  if (!(grid_position > 0.0)) return knots_[0].time_s;
  if (grid_position >= knots_[n].position) return knots_[n].time_s;
  for (std::size_t i = 1; i < n; ++i) {
    if (grid_position == knots_[i].position) return knots_[i].time_s;
  }
  // Newton's method usually finds the time with an error below kErrorS. In this case, the bisection
  // below evaluates GridPosition only within kErrorS of that time, and elsewhere compares times.
  constexpr double kErrorS = 1e-9;
  std::size_t i = 0;
  while (knots_[i + 1].position < grid_position) ++i;
  const double h = knots_[i + 1].time_s - knots_[i].time_s;
  const double rise = knots_[i + 1].position - knots_[i].position;
  const double m0 = knots_[i].slope * h;
  const double m1 = knots_[i + 1].slope * h;
  const double quadratic = 3.0 * rise - 2.0 * m0 - m1;
  const double cubic = m0 + m1 - 2.0 * rise;
  double s = (grid_position - knots_[i].position) / rise;
  for (int k = 0; k < 4; ++k) {
    const double value = knots_[i].position + s * (m0 + s * (quadratic + s * cubic));
    const double slope = m0 + s * (2.0 * quadratic + 3.0 * s * cubic);
    s = std::clamp(s + (grid_position - value) / slope, 0.0, 1.0);
  }
  const double near_s = knots_[i].time_s + s * h;
  const bool is_near = GridPosition(near_s - kErrorS) < grid_position &&
                       GridPosition(near_s + kErrorS) >= grid_position;
  double low = knots_[0].time_s;
  double high = knots_[n].time_s;
  while (high - low > 1e-12) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    const bool is_before = is_near && std::fabs(middle - near_s) > kErrorS
                               ? middle < near_s
                               : GridPosition(middle) < grid_position;
    (is_before ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double TimeWarp::GenericTimeAt(double time_s) const {
  const double u = GridPosition(time_s);
  std::size_t i = static_cast<std::size_t>(interval_count_) - 1;
  while (i > 0 && u < knots_[i].position) --i;
  return static_cast<double>(i) +
         (u - knots_[i].position) / (knots_[i + 1].position - knots_[i].position);
}

}  // namespace stridewire
