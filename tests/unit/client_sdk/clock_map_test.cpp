#include "clock_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace stridewire::client {
namespace {

constexpr double kTickS = 1.0 / 60.0;

TEST(ClockMap, SubtractsTheSmallestDelay) {
  // The server's clock is 100 s behind; delays are 20 ms plus an exponential jitter of 15 ms.
  const std::uint64_t seed = 11;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::exponential_distribution<double> jitter_s(1.0 / 0.015);
  ClockMap clock;
  double worst_s = 0.0;
  double arrival_s = 0.0;
  for (int tick = 0; tick < 60 * 60; ++tick) {
    const double server_s = tick * kTickS;
    arrival_s =
        std::max(arrival_s, server_s + 100.0 + 0.02 + jitter_s(random));  // TCP preserves the order
    clock.AddSample(arrival_s, server_s);
    if (tick > 120) {
      worst_s = std::max(worst_s, std::abs(clock.ServerTime(arrival_s) - (arrival_s - 100.02)));
    }
  }
  EXPECT_LT(worst_s, 0.003);  // a fifth of the mean jitter
}

TEST(ClockMap, NeverDecreasesOrJumps) {
  const std::uint64_t seed = 5;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> jitter_s(0.0, 0.1);
  ClockMap clock;
  double last_s = 0.0;
  double last_local_s = 0.0;
  double arrival_s = 0.0;
  for (int tick = 0; tick < 3600; ++tick) {
    const double server_s = tick * kTickS;
    // The delay increases by 80 ms in the middle.
    arrival_s = std::max(arrival_s, server_s + (tick < 1800 ? 0.0 : 0.08) + jitter_s(random));
    clock.AddSample(arrival_s, server_s);
    const double now_s = clock.ServerTime(arrival_s);
    if (arrival_s > ClockMap::kSettleS + 0.1) {
      const double passed_s = arrival_s - last_local_s;
      ASSERT_GE(now_s - last_s, (1.0 - ClockMap::kSlew) * passed_s - 1e-9) << "tick " << tick;
      ASSERT_LE(now_s - last_s, (1.0 + ClockMap::kSlew) * passed_s + 1e-9) << "tick " << tick;
    }
    last_s = now_s;
    last_local_s = arrival_s;
  }
}

TEST(ClockMap, FollowsAFasterClock) {
  ClockMap clock;
  for (int tick = 0; tick < 6000; ++tick) {
    const double local_s = tick * kTickS;
    clock.AddSample(local_s, 1.0002 * local_s);
  }
  const double local_s = 6000 * kTickS;
  EXPECT_NEAR(clock.ServerTime(local_s), 1.0002 * local_s, 0.002);
}

TEST(ClockMap, JumpsToAnotherClock) {
  ClockMap clock;
  for (int tick = 0; tick < 60; ++tick) clock.AddSample(tick * kTickS, tick * kTickS);
  clock.AddSample(2.0, 502.0);
  EXPECT_NEAR(clock.ServerTime(2.0), 502.0, 1e-9);
}

TEST(ClockMap, IgnoresASingleLateMessage) {
  ClockMap clock;
  for (int tick = 0; tick < 120; ++tick) clock.AddSample(tick * kTickS, tick * kTickS);
  clock.AddSample(3.0, 2.0);  // one second late
  EXPECT_NEAR(clock.ServerTime(3.0), 3.0, 1e-9);
}

TEST(ClockMap, IsNotReadyBeforeTheFirstSample) {
  ClockMap clock;
  EXPECT_FALSE(clock.ready());
  clock.AddSample(1.0, 5.0);
  EXPECT_TRUE(clock.ready());
  clock.Reset();
  EXPECT_FALSE(clock.ready());
}

}  // namespace
}  // namespace stridewire::client
