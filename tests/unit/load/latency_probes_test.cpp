#include "latency_probes.h"

#include <gtest/gtest.h>

namespace stridewire::load {
namespace {

constexpr std::int64_t kMs = 1'000'000;

double OnlyTimeMs(const LatencyProbes& probes) {
  EXPECT_EQ(probes.times().count(), 1u);
  return probes.times().max_ms();
}

TEST(LatencyProbes, MeasureUntilThePoseAfterTheEvent) {
  LatencyProbes probes(2);
  probes.Schedule(1, 7, 100 * kMs, 105 * kMs);
  probes.Started(1, 7, 50);
  probes.Pose(1, 49, 110 * kMs, true);   // The pose still belongs to the previous movement.
  probes.Pose(1, 50, 116 * kMs, false);  // The movement has started, but the pose has not changed.
  EXPECT_EQ(probes.open_count(), 1u);
  probes.Pose(1, 51, 133 * kMs, true);
  probes.Pose(1, 52, 150 * kMs, true);
  EXPECT_EQ(OnlyTimeMs(probes), 33.0);
  EXPECT_EQ(probes.open_count(), 0u);
}

TEST(LatencyProbes, MeasureUntilAPoseThatArrivedBeforeTheEvent) {
  LatencyProbes probes(1);
  probes.Schedule(0, 7, 0, 0);
  probes.Pose(0, 50, 20 * kMs, true);
  probes.Pose(0, 51, 37 * kMs, true);
  probes.Started(0, 7, 50);
  EXPECT_EQ(OnlyTimeMs(probes), 20.0);
}

TEST(LatencyProbes, IgnorePosesOfAnEarlierMovement) {
  LatencyProbes probes(1);
  probes.Schedule(0, 7, 0, 0);
  probes.Pose(0, 40, 10 * kMs, true);
  probes.Pose(0, 50, 20 * kMs, true);
  probes.Started(0, 7, 50);
  EXPECT_EQ(OnlyTimeMs(probes), 20.0);

  LatencyProbes late(1);
  late.Schedule(0, 7, 0, 0);
  late.Pose(0, 40, 10 * kMs, true);
  late.Started(0, 7, 60);
  late.Pose(0, 59, 50 * kMs, true);
  late.Pose(0, 60, 66 * kMs, true);
  EXPECT_EQ(OnlyTimeMs(late), 66.0);
}

TEST(LatencyProbes, IgnoreOtherRequestsAndAvatars) {
  LatencyProbes probes(2);
  probes.Schedule(0, 7, 0, 0);
  probes.Started(0, 6, 50);
  probes.Started(1, 7, 50);
  probes.Rejected(0, 6);
  probes.Pose(1, 50, 20 * kMs, true);
  EXPECT_EQ(probes.times().count(), 0u);
  EXPECT_EQ(probes.open_count(), 1u);
}

TEST(LatencyProbes, CountAnInvisibleStepWithItsWaitingTime) {
  LatencyProbes probes(3);
  probes.Schedule(0, 7, 0, 0);
  // The next step is due although the previous one never became visible.
  probes.Schedule(0, 8, 900 * kMs, 1000 * kMs);
  EXPECT_EQ(OnlyTimeMs(probes), 1000.0);
  EXPECT_EQ(probes.Finish(1500 * kMs), 1u);
  EXPECT_EQ(probes.times().count(), 2u);
  EXPECT_EQ(probes.open_count(), 0u);
}

TEST(LatencyProbes, IgnoreRejectedAndAbandonedSteps) {
  LatencyProbes probes(2);
  probes.Schedule(0, 7, 0, 0);
  probes.Schedule(1, 8, 0, 0);
  probes.Rejected(0, 7);
  probes.Abandon(1);
  probes.Abandon(1);
  EXPECT_EQ(probes.open_count(), 0u);
  EXPECT_EQ(probes.Finish(1000 * kMs), 0u);
  EXPECT_EQ(probes.times().count(), 0u);
}

}  // namespace
}  // namespace stridewire::load
