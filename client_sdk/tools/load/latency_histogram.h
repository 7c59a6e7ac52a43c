#pragma once

#include <cstdint>
#include <vector>

namespace stridewire::load {

/// Counts times in log-linear bins like HdrHistogram: bins of 1 us up to 255 us, then 128 bins per
/// octave. Quantiles are rounded up by at most 1/128 (0.8 %). The maximum is exact to 1 us. Takes
/// 30 KiB and allocates only in its constructor. Not thread-safe: use one per thread and merge
/// them.
class LatencyHistogram {
 public:
  /// Longer times are counted as this time (19 hours).
  static constexpr std::int64_t kMaxUs = (std::int64_t{1} << 36) - 1;

  LatencyHistogram();

  /// Adds a time, rounded up to whole microseconds. Negative times count as 0.
  void RecordNs(std::int64_t time_ns);

  /// Adds all times of another histogram.
  void Merge(const LatencyHistogram& other);

  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] double max_ms() const { return 1e-3 * static_cast<double>(max_us_); }

  /// Returns the q-quantile in milliseconds, q from 0 to 1. Returns 0 if there are no times.
  [[nodiscard]] double QuantileMs(double q) const;

 private:
  std::vector<std::uint64_t> bins_;
  std::uint64_t count_ = 0;
  std::int64_t max_us_ = 0;
};

}  // namespace stridewire::load
