#include "playout_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace stridewire::client {
namespace {

constexpr double kIntervalS = 1.0 / 60.0;

/// Adds messages from `from_s` until `to_s` of local time and returns the number of jumps.
int Add(PlayoutClock& clock, double from_s, double to_s, double delay_s) {
  int jumps = 0;
  for (double local_s = from_s; local_s < to_s; local_s += kIntervalS) {
    jumps += clock.AddSample(local_s, local_s - delay_s, kIntervalS) ? 1 : 0;
  }
  return jumps;
}

double Delay(const PlayoutClock& clock, double local_s) {
  return local_s - clock.DisplayTime(local_s);
}

TEST(PlayoutClock, BeginsWithADelayAndShortensIt) {
  PlayoutClock clock;
  EXPECT_FALSE(clock.ready());
  Add(clock, 0.0, 0.01, 0.05);
  ASSERT_TRUE(clock.ready());
  EXPECT_NEAR(Delay(clock, 0.0), 0.05 + PlayoutClock::kFirstDelayS, 1e-9);
  Add(clock, kIntervalS, 6.0, 0.05);
  EXPECT_NEAR(Delay(clock, 6.0), 0.05 + 1.25 * kIntervalS, 1e-3);
}

TEST(PlayoutClock, IgnoresAStallButNotASlowerLink) {
  PlayoutClock clock;
  Add(clock, 0.0, 6.0, 0.05);
  const double before_s = Delay(clock, 6.0);
  // The messages of 2 s arrive together.
  for (double server_s = 6.0; server_s < 8.0; server_s += kIntervalS) {
    EXPECT_FALSE(clock.AddSample(8.05, server_s, kIntervalS));
  }
  EXPECT_EQ(Add(clock, 8.06, 9.0, 0.05), 0);
  EXPECT_NEAR(Delay(clock, 9.0), before_s, 1e-3);
  // From now on, all messages take 2 s longer.
  EXPECT_EQ(Add(clock, 11.0, 14.0, 2.05), 1);
  EXPECT_NEAR(Delay(clock, 14.0), 2.05 + 1.25 * kIntervalS, 0.01);
}

TEST(PlayoutClock, JumpsToAnotherClock) {
  PlayoutClock clock;
  Add(clock, 0.0, 6.0, 0.05);
  EXPECT_TRUE(clock.AddSample(6.0, 100.0, kIntervalS));
  EXPECT_NEAR(clock.DisplayTime(6.0), 100.0 - PlayoutClock::kFirstDelayS, 1e-9);
}

// For example, a debugger has stopped the client, which then needs seconds to read what has
// arrived.
TEST(PlayoutClock, ReturnsToThePresentAfterABacklog) {
  PlayoutClock clock;
  Add(clock, 0.0, 6.0, 0.05);
  // The messages of 11 s arrive within 3 s.
  constexpr double kPauseS = 11.0;
  constexpr double kReadS = 3.0;
  for (double server_s = 6.0; server_s < 6.0 + kPauseS; server_s += kIntervalS) {
    const double share = (server_s - 6.0) / kPauseS;
    clock.AddSample(6.0 + kPauseS - kReadS + share * kReadS + 0.05, server_s, kIntervalS);
  }
  EXPECT_GT(Delay(clock, 17.05), 1.0);  // Old poses are displayed instead of none.
  EXPECT_EQ(Add(clock, 17.06, 19.0, 0.05), 1);
  EXPECT_LT(Delay(clock, 19.0), 0.05 + 1.25 * kIntervalS + PlayoutClock::kMaxExcessS);
}

TEST(PlayoutClock, NeverRunsMoreThanFivePercentFasterOrSlower) {
  const std::uint64_t seed = 3;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> jitter_s(0.0, 1.0);
  PlayoutClock clock;
  double arrival_s = 0.0;
  double last_local_s = 0.0;
  double last_s = 0.0;
  for (int tick = 0; tick < 7200; ++tick) {
    const double server_s = tick * kIntervalS;
    const double range_s = tick / 600 % 2 == 0 ? 0.01 : 0.2;
    arrival_s = std::max(arrival_s + 1e-6, server_s + range_s * jitter_s(random));
    EXPECT_FALSE(clock.AddSample(arrival_s, server_s, kIntervalS));
    const double shown_s = clock.DisplayTime(arrival_s);
    if (tick > 0) {
      const double passed_s = arrival_s - last_local_s;
      ASSERT_GE(shown_s - last_s, (1.0 - PlayoutClock::kMaxRate) * passed_s - 1e-9) << tick;
      ASSERT_LE(shown_s - last_s, (1.0 + PlayoutClock::kMaxRate) * passed_s + 1e-9) << tick;
    }
    last_local_s = arrival_s;
    last_s = shown_s;
  }
}

}  // namespace
}  // namespace stridewire::client
