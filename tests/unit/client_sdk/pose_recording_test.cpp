#include "pose_recording.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stridewire/protocol/decode.h"
#include "test_world.h"
#include "world_view.h"

namespace stridewire::client {
namespace {

/// A view that records, so that live and recorded poses can be compared.
class PoseRecordingTest : public testing::Test {
 protected:
  void Use(double length_s, std::size_t max_bytes) {
    view_ = std::make_unique<WorldView>(512, budget_, PoseRecording(length_s, max_bytes));
    view_->SetInfo(test_world::WorldInfo(1, 1, "plaza"));
  }
  void SetUp() override { Use(2.0, std::size_t{1} << 20); }

  void Take(std::uint64_t tick, const std::vector<test_world::AvatarAt>& avatars,
            std::uint16_t shard = 0, protocol::PoseMode mode = protocol::PoseMode::kFull,
            bool is_partial = false) {
    const auto frame =
        test_world::PoseFrame(1, tick, avatars, mode, shard, test_world::kJoints, is_partial);
    const auto message =
        protocol::DecodeMessage(protocol::ParseFrame(frame, protocol::Sender::kServer).value());
    ASSERT_TRUE(view_->Apply(std::get<protocol::PoseBatch>(message.value()), 1, counts_));
  }

  const CrowdPose& Live(double time_s) {
    view_->SampleAll(time_s, live_, held_);
    return live_;
  }
  const CrowdPose& Recorded(double time_s) {
    view_->recording().SampleAll(time_s, [](protocol::AvatarId) { return true; }, recorded_);
    return recorded_;
  }

  PoseBudget budget_{std::size_t{1} << 24, 0};
  WorldView::Counts counts_;
  std::unique_ptr<WorldView> view_;
  CrowdPose live_;
  CrowdPose recorded_;
  DisplayCounts held_;
};

TEST_F(PoseRecordingTest, SamplesEqualLivePoses) {
  constexpr auto kCompact = protocol::PoseMode::kCompact;
  for (std::uint64_t tick = 1; tick <= 240; ++tick) {
    // Avatar 5 moves from shard 1 to shard 0 at tick 120. The first shard is not in order.
    std::vector<test_world::AvatarAt> first = {{9}, {2}};
    if (tick >= 120) first.push_back({5});
    Take(tick, first, 0, kCompact);
    Take(tick,
         tick < 120 ? std::vector<test_world::AvatarAt>{{5}} : std::vector<test_world::AvatarAt>{},
         1, kCompact);
  }
  EXPECT_NEAR(view_->recording().first_time_s(), 2.0, 1e-9);
  EXPECT_NEAR(view_->recording().last_time_s(), 4.0, 1e-9);
  for (double time_s = 2.1; time_s < 3.9; time_s += 0.0123) {
    const CrowdPose& live = Live(time_s);
    const CrowdPose& recorded = Recorded(time_s);
    ASSERT_EQ(live.avatars, (std::vector<std::uint32_t>{2, 5, 9}));
    ASSERT_EQ(recorded.avatars, live.avatars);
    EXPECT_EQ(recorded.roots_m, live.roots_m);
    EXPECT_EQ(recorded.rotations, live.rotations);
    EXPECT_EQ(recorded.flags, live.flags);
  }
  EXPECT_TRUE(Recorded(1.9).avatars.empty());
  EXPECT_TRUE(Recorded(4.0 + PoseRecording::kKeepS + 0.1).avatars.empty());
  const std::uint32_t wanted = 5;
  view_->recording().SampleAll(3.0, [&](protocol::AvatarId a) { return a == wanted; }, recorded_);
  EXPECT_EQ(recorded_.avatars, std::vector<std::uint32_t>{wanted});
}

TEST_F(PoseRecordingTest, DoesNotInterpolateAcrossDiscontinuities) {
  Take(60, {{1, 0, Vec3(0.0f)}});
  Take(61, {{1, 0, Vec3(1.0f)}});
  Take(62, {{1, protocol::kPoseDiscontinuity, Vec3(50.0f)}});
  view_->Break();
  Take(63, {{1, 0, Vec3(100.0f)}});
  EXPECT_NEAR(Recorded(60.5 / 60.0).roots_m[0].x, 0.5f, 1e-6f);
  EXPECT_EQ(Recorded(61.5 / 60.0).roots_m[0].x, 1.0f);
  EXPECT_EQ(recorded_.flags[0], kCrowdHeld);
  EXPECT_EQ(Recorded(62.5 / 60.0).roots_m[0].x, 50.0f);
  EXPECT_EQ(recorded_.flags[0], kCrowdHeld | kCrowdDiscontinuity);
  EXPECT_EQ(Recorded(62.0 / 60.0).flags[0], kCrowdDiscontinuity);
}

TEST_F(PoseRecordingTest, IsBoundedInBytes) {
  Use(20.0, 4096);
  for (std::uint64_t tick = 1; tick <= 200; ++tick) {
    Take(tick, {{1}});
    ASSERT_LE(view_->recording().bytes(), 4096u);
  }
  EXPECT_GT(view_->recording().first_time_s(), 1.0);
  EXPECT_NEAR(view_->recording().last_time_s(), 200.0 / 60.0, 1e-9);
  view_->recording().Clear();
  EXPECT_EQ(view_->recording().bytes(), 0u);
  EXPECT_TRUE(std::isnan(view_->recording().first_time_s()));
  EXPECT_TRUE(std::isnan(view_->recording().last_time_s()));
}

TEST_F(PoseRecordingTest, CountsAndLimitsDecodedTicks) {
  constexpr std::size_t kAvatars = 50;
  std::vector<test_world::AvatarAt> avatars(kAvatars);
  for (std::size_t i = 0; i < kAvatars; ++i) avatars[i].avatar = static_cast<std::uint32_t>(i + 1);
  constexpr std::size_t kDecodedBytes = kAvatars * test_world::kJoints * sizeof(Quat);
  for (std::uint64_t tick = 1; tick <= 60; ++tick) Take(tick, avatars);
  const std::size_t encoded_bytes = view_->recording().bytes();
  ASSERT_EQ(Recorded(30.5 / 60.0).avatars.size(), kAvatars);
  EXPECT_GE(view_->recording().bytes(), encoded_bytes + 4 * kDecodedBytes);

  // There is not enough memory for the decoded ticks that interpolation needs.
  constexpr std::size_t kLimitBytes = 6 * kDecodedBytes;
  Use(20.0, kLimitBytes);
  for (std::uint64_t tick = 1; tick <= 60; ++tick) {
    Take(tick, avatars);
    ASSERT_LE(view_->recording().bytes(), kLimitBytes);
    if (tick < 4) continue;
    const double time_s = view_->recording().last_time_s() - 0.5 / 60.0;
    ASSERT_EQ(Recorded(time_s).avatars.size(), kAvatars) << tick;
    ASSERT_LE(view_->recording().bytes(), kLimitBytes);
  }
}

TEST_F(PoseRecordingTest, CanBeDisabled) {
  Use(0.0, 4096);
  Take(1, {{1}});
  EXPECT_EQ(view_->recording().bytes(), 0u);
  EXPECT_TRUE(Recorded(1.0 / 60.0).avatars.empty());
}

// Each ring of a region has batches of its own, in its own mode.
TEST_F(PoseRecordingTest, AvatarsThatCrossARingStayVisible) {
  constexpr auto kQuantised = protocol::PoseMode::kQuantised;
  for (std::uint64_t tick = 60; tick < 80; ++tick) {
    const bool crossed = tick >= 70;
    std::vector<test_world::AvatarAt> inner = {{1}};
    if (crossed) inner.push_back({2});
    Take(tick, inner, 0, protocol::PoseMode::kFull, true);
    if (!crossed) Take(tick, {{2}}, 0, kQuantised, true);
  }
  for (const std::uint64_t tick : {60u, 69u, 70u, 79u}) {
    const double time_s = test_world::TickTime(tick);
    EXPECT_EQ(Recorded(time_s).avatars, (std::vector<std::uint32_t>{1, 2}));
    EXPECT_NEAR(recorded_.roots_m[1].z, test_world::RootAt(time_s, 2).z, 1e-4f);
  }
}

}  // namespace
}  // namespace stridewire::client
