#include "latency_histogram.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace stridewire::load {
namespace {

constexpr int kExactBits = 8;  // Values below 2^kExactBits have separate bins.
constexpr int kBinsPerOctave = 1 << (kExactBits - 1);
constexpr std::size_t kExactBins = std::size_t{1} << kExactBits;

/// Returns the number of bits by which to shift a value right so that kExactBits bits remain.
int Shift(std::int64_t us) {
  return std::max(0, static_cast<int>(std::bit_width(static_cast<std::uint64_t>(us))) - kExactBits);
}

std::size_t BinOf(std::int64_t us) {
  const int shift = Shift(us);
  if (shift == 0) return static_cast<std::size_t>(us);
  const auto within = static_cast<std::size_t>(us >> shift) - kBinsPerOctave;
  return kExactBins + static_cast<std::size_t>(shift - 1) * kBinsPerOctave + within;
}

/// Returns the largest value of a bin.
std::int64_t UpperUs(std::size_t bin) {
  if (bin < kExactBins) return static_cast<std::int64_t>(bin);
  const std::size_t shift = (bin - kExactBins) / kBinsPerOctave + 1;
  const std::size_t within = (bin - kExactBins) % kBinsPerOctave + kBinsPerOctave;
  return static_cast<std::int64_t>(((within + 1) << shift) - 1);
}

}  // namespace

LatencyHistogram::LatencyHistogram() : bins_(BinOf(kMaxUs) + 1, 0) {}

void LatencyHistogram::RecordNs(std::int64_t time_ns) {
  const std::int64_t us = std::min(time_ns <= 0 ? 0 : (time_ns - 1) / 1000 + 1, kMaxUs);
  ++bins_[BinOf(us)];
  ++count_;
  max_us_ = std::max(max_us_, us);
}

void LatencyHistogram::Merge(const LatencyHistogram& other) {
  for (std::size_t bin = 0; bin < bins_.size(); ++bin) bins_[bin] += other.bins_[bin];
  count_ += other.count_;
  max_us_ = std::max(max_us_, other.max_us_);
}

double LatencyHistogram::QuantileMs(double q) const {
  if (count_ == 0) return 0.0;
  const double rank = std::ceil(std::clamp(q, 0.0, 1.0) * static_cast<double>(count_));
  const auto wanted = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(rank));
  std::uint64_t below = 0;
  for (std::size_t bin = 0; bin < bins_.size(); ++bin) {
    below += bins_[bin];
    if (below >= wanted) return 1e-3 * static_cast<double>(std::min(UpperUs(bin), max_us_));
  }
  return max_ms();
}

}  // namespace stridewire::load
