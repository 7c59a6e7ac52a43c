#include "base/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace stridewire::server {
namespace {

using testing::HasSubstr;

TEST(Metrics, SumsOverThreads) {
  Metrics metrics(2);
  metrics.shard(0).ticks.Add(3);
  metrics.shard(1).ticks.Add(4);
  metrics.main().http_requests.Add();
  metrics.shard(1).avatars.Set(7);
  metrics.shard(0).Reached(Limit::kQueue, 2);
  metrics.set_world_count(5);
  const std::string text = metrics.Text();
  EXPECT_THAT(text, HasSubstr("stridewire_ticks_total 7\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_http_requests_total 1\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_avatars 7\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_worlds 5\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_limit_reached_total{limit=\"max_queue\"} 2\n"));
}

TEST(Metrics, HistogramsAreCumulativeAndHaveMaxima) {
  Metrics metrics(2);
  metrics.shard(0).tick.Observe(0.000'05);
  metrics.shard(0).tick.Observe(0.003);
  metrics.shard(1).tick.Observe(0.004);
  metrics.shard(1).tick.Observe(5.0);
  std::string text = metrics.Text();
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_bucket{le=\"0.0001\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_bucket{le=\"0.002\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_bucket{le=\"0.004\"} 3\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_bucket{le=\"1\"} 3\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_bucket{le=\"+Inf\"} 4\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_count 4\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_max 5\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_max_since_scrape 5\n"));
  // The next scrape reports only values that were observed after the previous one.
  metrics.shard(0).tick.Observe(0.25);
  text = metrics.Text();
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_max 5\n"));
  EXPECT_THAT(text, HasSubstr("stridewire_tick_seconds_max_since_scrape 0.25\n"));
}

TEST(Metrics, ReportsCpuTimePerShard) {
  Metrics metrics(2);
  metrics.shard(1).cpu_ns.Set(1'500'000'000);
  EXPECT_THAT(metrics.Text(), HasSubstr("stridewire_shard_cpu_seconds_total{shard=\"0\"} 0\n"
                                        "stridewire_shard_cpu_seconds_total{shard=\"1\"} 1.5\n"));
}

TEST(Metrics, LimitNamesAreUnique) {
  const std::set<std::string_view> names(kLimitNames.begin(), kLimitNames.end());
  EXPECT_EQ(names.size(), kLimitNames.size());
  EXPECT_FALSE(names.contains(""));
}

}  // namespace
}  // namespace stridewire::server
