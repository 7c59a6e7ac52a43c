#pragma once

#include <cstdint>
#include <vector>

namespace stridewire::load {

/// Counts times in log-linear bins, as HdrHistogram does: single microseconds up to 255, from there
/// 128 bins an octave. A quantile is never below the true one and at most 1/128 (0.8 %) above it;
/// the maximum is exact. A fixed 29 KiB; Record never allocates. Not thread-safe: one a thread, then
/// Merge.
class LatencyHistogram {
 public:
  /// Longer times count as this long (19 hours).
  static constexpr std::int64_t kMaxUs = (std::int64_t{1} << 36) - 1;

  LatencyHistogram();

  /// Nanoseconds are rounded up to whole microseconds; negative times count as 0.
  void RecordNs(std::int64_t time_ns);

  void Merge(const LatencyHistogram& other);

  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] double max_ms() const { return 1e-3 * static_cast<double>(max_us_); }

  /// The time that a share `q` in [0, 1] of all times does not exceed; 0 when there are none.
  [[nodiscard]] double QuantileMs(double q) const;

 private:
  std::vector<std::uint64_t> bins_;
  std::uint64_t count_ = 0;
  std::int64_t max_us_ = 0;
};

}  // namespace stridewire::load
