#include "server_metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

namespace stridewire::load {
namespace {

/// Formats a page like the server does. `bins` are cumulative.
std::string Page(int below_1ms, int below_2ms, int all, double max_s, double recent_s, int missed) {
  const auto line = [](const std::string& name, double value) {
    return name + " " + std::to_string(value) + "\n";
  };
  return "# HELP stridewire_tick_seconds Time a shard's tick took.\n"
         "# TYPE stridewire_tick_seconds histogram\n" +
         line("stridewire_tick_seconds_bucket{le=\"0.001\"}", below_1ms) +
         line("stridewire_tick_seconds_bucket{le=\"0.002\"}", below_2ms) +
         line("stridewire_tick_seconds_bucket{le=\"+Inf\"}", all) +
         line("stridewire_tick_seconds_sum", 0.25) + line("stridewire_tick_seconds_count", all) +
         line("stridewire_tick_seconds_max", max_s) +
         line("stridewire_tick_seconds_max_since_scrape", recent_s) +
         line("stridewire_avatars", 7) +
         line("stridewire_limit_reached_total{limit=\"max {sessions}\"}", 1) +
         line("stridewire_ticks_missed_total", missed);
}

ServerMetrics Parsed(const std::string& page) {
  const Expected<ServerMetrics> metrics = ParseServerMetrics(page);
  EXPECT_TRUE(metrics.has_value()) << Describe(metrics.error());
  return metrics.value_or(ServerMetrics{});
}

TEST(ServerMetrics, ParsePrometheusText) {
  const ServerMetrics metrics = Parsed(Page(50, 90, 100, 0.03, 0.02, 4));
  EXPECT_EQ(metrics.tick_bins,
            (std::map<double, double>{{0.001, 50.0}, {0.002, 90.0}, {INFINITY, 100.0}}));
  EXPECT_EQ(metrics.tick_max_s, 0.03);
  EXPECT_EQ(metrics.tick_max_since_scrape_s, 0.02);
  EXPECT_EQ(metrics.ticks_missed, 4.0);
  EXPECT_EQ(metrics.avatars, 7.0);
}

TEST(ServerMetrics, SumSamplesOfAllShards) {
  std::string page = Page(50, 90, 100, 0.03, 0.02, 4);
  page +=
      "stridewire_ticks_missed_total{shard=\"1\"} 5\n"
      "stridewire_tick_seconds_max{shard=\"1\"} 0.5\n"
      "stridewire_tick_seconds_bucket{shard=\"1\",le=\"0.001\"} 8 1700000000000\n";
  const ServerMetrics metrics = Parsed(page);
  EXPECT_EQ(metrics.ticks_missed, 9.0);
  EXPECT_EQ(metrics.tick_max_s, 0.5);
  EXPECT_EQ(metrics.tick_bins.at(0.001), 58.0);
}

TEST(ServerMetrics, ReportAnInvalidLine) {
  for (const char* line :
       {"x", "x ", "{a=\"b\"} 1", "x{a=\"b\" 1", "x 1.5.2", "x one",
        "stridewire_tick_seconds_bucket{le=\"a\"} 1", "stridewire_tick_seconds_bucket 1"}) {
    const Expected<ServerMetrics> metrics = ParseServerMetrics("ok 1\n" + std::string(line));
    ASSERT_FALSE(metrics.has_value()) << line;
    EXPECT_EQ(metrics.error().code, ErrorCode::kMalformed) << line;
    EXPECT_EQ(metrics.error().index, 2) << line;
  }
}

TEST(ServerMetrics, ReportAMissingMetric) {
  const std::string page = Page(50, 90, 100, 0.03, 0.02, 4);
  for (const std::string name :
       {"stridewire_avatars", "stridewire_ticks_missed_total", "stridewire_tick_seconds_max",
        "stridewire_tick_seconds_max_since_scrape", "stridewire_tick_seconds_bucket"}) {
    std::string without;
    for (std::size_t at = 0; at < page.size();) {
      const std::size_t end = page.find('\n', at) + 1;
      const std::string line = page.substr(at, end - at);
      if (line.substr(0, line.find_first_of("{ ")) != name) without += line;
      at = end;
    }
    const Expected<ServerMetrics> metrics = ParseServerMetrics(without);
    ASSERT_FALSE(metrics.has_value()) << name;
    EXPECT_EQ(metrics.error().code, ErrorCode::kNotFound);
    EXPECT_EQ(metrics.error().where, name);
  }
}

TEST(ServerMetrics, SurviveMutatedPages) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  const std::string page = Page(50, 90, 100, 0.03, 0.02, 4);
  int refused_count = 0;
  for (int round = 0; round < 20'000; ++round) {
    std::string text = page;
    for (int change = 0; change < 3; ++change) {
      const std::size_t at = random() % text.size();
      if (random() % 2 == 0) {
        text[at] = static_cast<char>(random() % 256);
      } else {
        text.erase(at, random() % 20);
        if (text.empty()) text.push_back('\n');
      }
    }
    const Expected<ServerMetrics> metrics = ParseServerMetrics(text);
    if (!metrics) {
      ++refused_count;
      EXPECT_NE(std::string(metrics.error().text), "");
    } else {
      (void)TicksBetween(ServerMetrics{}, *metrics);
    }
  }
  EXPECT_GT(refused_count, 0);
}

TEST(TicksBetweenScrapes, CountTicksAfterTheFirstRead) {
  const ServerMetrics before = Parsed(Page(1000, 1000, 1000, 0.03, 0.03, 4));
  const ServerMetrics after = Parsed(Page(1040, 1100, 1100, 0.03, 0.0018, 4));
  const Quantiles ticks = TicksBetween(before, after);
  // 40 ticks take less than 1 ms and 60 take 1 to 2 ms, so the 50th is a sixth into the second bin.
  EXPECT_NEAR(ticks.p50, 1.0 + 10.0 / 60.0, 1e-9);
  EXPECT_NEAR(ticks.p99, 1.8, 1e-9);  // 1.983 by interpolation, but none took longer than 1.8.
  EXPECT_NEAR(ticks.max, 1.8, 1e-9);
}

TEST(TicksBetweenScrapes, TakeANewMaximum) {
  // Another program has read the page, which has reset the recent maximum.
  const ServerMetrics before = Parsed(Page(0, 0, 0, 0.001, 0.001, 0));
  const ServerMetrics after = Parsed(Page(10, 10, 11, 0.25, 0.0005, 0));
  const Quantiles ticks = TicksBetween(before, after);
  EXPECT_EQ(ticks.max, 250.0);
  EXPECT_EQ(ticks.p99, 250.0);  // In the last bin, which has no upper bound.
}

TEST(TicksBetweenScrapes, AreZeroWithoutTicks) {
  const ServerMetrics both = Parsed(Page(5, 5, 5, 0.001, 0.0, 0));
  const Quantiles ticks = TicksBetween(both, both);
  EXPECT_EQ(ticks.p50, 0.0);
  EXPECT_EQ(ticks.p99, 0.0);
  EXPECT_EQ(ticks.max, 0.0);
}

}  // namespace
}  // namespace stridewire::load
