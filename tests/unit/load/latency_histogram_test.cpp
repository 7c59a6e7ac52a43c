#include "latency_histogram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace stridewire::load {
namespace {

constexpr std::int64_t kUs = 1000;  // nanoseconds

TEST(LatencyHistogram, IsEmptyAtFirst) {
  const LatencyHistogram times;
  EXPECT_EQ(times.count(), 0u);
  EXPECT_EQ(times.QuantileMs(0.5), 0.0);
  EXPECT_EQ(times.max_ms(), 0.0);
}

TEST(LatencyHistogram, HasOneBinPerMicrosecondUpTo255) {
  LatencyHistogram times;
  for (int us = 0; us < 256; ++us) times.RecordNs(us * kUs);
  for (int us = 0; us < 256; ++us) {
    EXPECT_NEAR(times.QuantileMs((us + 1) / 256.0), 1e-3 * us, 1e-12);
  }
}

TEST(LatencyHistogram, RoundsNanosecondsUp) {
  LatencyHistogram times;
  times.RecordNs(1);
  EXPECT_EQ(times.max_ms(), 0.001);
  times.RecordNs(1001);
  EXPECT_EQ(times.max_ms(), 0.002);
}

TEST(LatencyHistogram, CountsNegativeTimesAsZero) {
  LatencyHistogram times;
  times.RecordNs(-5);
  EXPECT_EQ(times.count(), 1u);
  EXPECT_EQ(times.max_ms(), 0.0);
}

TEST(LatencyHistogram, ClampsToItsLargestTime) {
  LatencyHistogram times;
  times.RecordNs(std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(times.max_ms(), 1e-3 * static_cast<double>(LatencyHistogram::kMaxUs));
  EXPECT_EQ(times.QuantileMs(1.0), times.max_ms());
}

// Compares quantiles with those of sorted values over twelve orders of magnitude.
TEST(LatencyHistogram, RoundsQuantilesUpByAtMostOne128th) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> exponent(0.0, 10.0);
  std::vector<std::int64_t> all_us;
  LatencyHistogram times;
  for (int i = 0; i < 20'000; ++i) {
    const auto us = static_cast<std::int64_t>(std::pow(10.0, exponent(random)));
    all_us.push_back(us);
    times.RecordNs(us * kUs);
  }
  std::ranges::sort(all_us);
  for (const double q : {0.0, 0.001, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto rank =
        static_cast<std::size_t>(std::max(1.0, std::ceil(q * static_cast<double>(all_us.size()))));
    const double true_ms = 1e-3 * static_cast<double>(all_us[rank - 1]);
    EXPECT_GE(times.QuantileMs(q), true_ms - 1e-9) << q;
    EXPECT_LE(times.QuantileMs(q), true_ms * (1.0 + 1.0 / 128.0) + 1e-9) << q;
  }
  EXPECT_NEAR(times.max_ms(), 1e-3 * static_cast<double>(all_us.back()), 1e-9);
}

TEST(LatencyHistogram, MergesLikeASingleHistogram) {
  LatencyHistogram all;
  LatencyHistogram even;
  LatencyHistogram odd;
  for (std::int64_t i = 1; i <= 1000; ++i) {
    all.RecordNs(i * i * kUs);
    (i % 2 == 0 ? even : odd).RecordNs(i * i * kUs);
  }
  even.Merge(odd);
  EXPECT_EQ(even.count(), all.count());
  EXPECT_EQ(even.max_ms(), all.max_ms());
  for (const double q : {0.1, 0.5, 0.99}) EXPECT_EQ(even.QuantileMs(q), all.QuantileMs(q));
}

}  // namespace
}  // namespace stridewire::load
