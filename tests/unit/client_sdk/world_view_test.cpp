#include "world_view.h"

#include <gtest/gtest.h>

#include "stridewire/protocol/decode.h"
#include "test_world.h"

namespace stridewire::client {
namespace {

class WorldViewTest : public testing::Test {
 protected:
  WorldViewTest() { view_.SetInfo(test_world::WorldInfo(1, 1, "plaza")); }

  Status Take(std::uint64_t tick, const std::vector<test_world::AvatarAt>& avatars,
              std::uint16_t shard = 0, protocol::PoseMode mode = protocol::PoseMode::kFull,
              bool is_partial = false) {
    const auto frame =
        test_world::PoseFrame(1, tick, avatars, mode, shard, test_world::kJoints, is_partial);
    const auto message =
        protocol::DecodeMessage(protocol::ParseFrame(frame, protocol::Sender::kServer).value());
    return view_.Apply(std::get<protocol::PoseBatch>(message.value()), 1, counts_);
  }

  PoseBudget budget_{std::size_t{1} << 20, 0};
  WorldView::Counts counts_;
  WorldView view_{8, budget_};
};

TEST_F(WorldViewTest, ListsAvatars) {
  ASSERT_TRUE(Take(1, {{3}, {1}, {2}}));
  EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{1, 2, 3}));
  ASSERT_TRUE(Take(2, {{3}, {1}}));
  EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{1, 3}));
  EXPECT_TRUE(view_.IsGone(2));
  EXPECT_NE(view_.Find(2), nullptr);  // can still be sampled at earlier times
  view_.Remove(1);
  EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{3}));
}

TEST_F(WorldViewTest, RevisionChangesWithTheListOfAvatars) {
  std::uint64_t revision = view_.revision();
  std::vector<std::uint32_t> avatars = view_.Avatars();
  const auto changed = [&] {
    const bool has_changed = std::exchange(revision, view_.revision()) != view_.revision();
    EXPECT_EQ(std::exchange(avatars, view_.Avatars()) != view_.Avatars(), has_changed);
    return has_changed;
  };
  ASSERT_TRUE(Take(1, {{3}, {1}}));
  EXPECT_TRUE(changed());
  ASSERT_TRUE(Take(2, {{3}, {1}}));
  EXPECT_FALSE(changed());
  ASSERT_TRUE(Take(3, {{3}}));
  EXPECT_TRUE(changed());
  view_.Remove(1);  // It is gone already.
  EXPECT_FALSE(changed());
  ASSERT_TRUE(Take(4, {{3}, {1}}));
  EXPECT_TRUE(changed());
  view_.SetFilter(std::set<protocol::AvatarId>{1});
  EXPECT_TRUE(changed());
  ASSERT_TRUE(Take(500, {}));
  EXPECT_TRUE(changed());
  ASSERT_TRUE(Take(1000, {}));  // Erases the avatar.
  EXPECT_FALSE(changed());
}

TEST_F(WorldViewTest, SamplesAllAvatarsAtATime) {
  ASSERT_TRUE(Take(60, {{2, protocol::kPoseStanding}, {1}}));
  ASSERT_TRUE(Take(61, {{2, protocol::kPoseStanding}, {1}}));
  ASSERT_TRUE(Take(62, {{2, protocol::kPoseStanding}}));
  EXPECT_EQ(view_.newest_time_s(), test_world::TickTime(62));
  CrowdPose crowd;
  DisplayCounts held;
  view_.SampleAll(60.5 / 60.0, crowd, held);
  EXPECT_EQ(crowd.avatars, (std::vector<std::uint32_t>{1, 2}));
  // There are no earlier poses, so both avatars have a discontinuity.
  EXPECT_EQ(crowd.flags,
            (std::vector<std::uint8_t>{kCrowdDiscontinuity, kCrowdDiscontinuity | kCrowdStanding}));
  EXPECT_NEAR(crowd.roots_m[1].z, test_world::RootAt(60.5 / 60.0, 2).z, 1e-5f);
  EXPECT_EQ(crowd.rotations.size(), 2u * test_world::kJoints);
  EXPECT_EQ(held.extrapolated + held.held, 0u);
  view_.SampleAll(61.5 / 60.0, crowd, held);
  EXPECT_EQ(crowd.flags, std::vector<std::uint8_t>{kCrowdStanding});  // Avatar 1 is gone.
  view_.SampleAll(62.5 / 60.0, crowd, held);
  EXPECT_EQ(crowd.avatars, std::vector<std::uint32_t>{2});
  EXPECT_EQ(crowd.flags[0], kCrowdStanding | kCrowdExtrapolated);
  EXPECT_EQ(held.extrapolated + held.held, 1u);
  view_.SampleAll(59.0 / 60.0, crowd, held);
  EXPECT_TRUE(crowd.avatars.empty());
}

// Subscriptions of different modes can have different avatars.
TEST_F(WorldViewTest, ModesAreIndependent) {
  constexpr auto kQuantised = protocol::PoseMode::kQuantised;
  for (std::uint64_t tick = 1; tick <= 3; ++tick) {
    ASSERT_TRUE(Take(tick, {{1}}));
    EXPECT_EQ(view_.Avatars().size(), tick == 1 ? 1u : 2u);
    ASSERT_TRUE(Take(tick, {{2}}, 0, kQuantised));
    EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{1, 2}));
  }
  ASSERT_TRUE(Take(4, {}, 0, kQuantised));
  EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{1}));
}

// A batch of a region need not contain all avatars of the region. After `left`, earlier batches are
// ignored.
TEST_F(WorldViewTest, AvatarsOfARegionStayUntilTheyLeave) {
  const auto partial = [&](std::uint64_t tick, const std::vector<test_world::AvatarAt>& avatars) {
    return Take(tick, avatars, 0, protocol::PoseMode::kFull, true);
  };
  const auto avatars = [&] { return view_.Avatars(); };
  ASSERT_TRUE(partial(1, {{1}, {2}, {3}}));
  ASSERT_TRUE(partial(5, {{2}}));
  EXPECT_EQ(avatars(), (std::vector<std::uint32_t>{1, 2, 3}));
  EXPECT_EQ(counts_.missing, 0u);
  view_.Leave(2, 8);
  view_.Leave(4, 8);  // its poses arrive later
  EXPECT_EQ(avatars(), (std::vector<std::uint32_t>{1, 3}));
  ASSERT_TRUE(partial(7, {{2}, {3}, {4}}));
  EXPECT_EQ(avatars(), (std::vector<std::uint32_t>{1, 3}));
  ASSERT_TRUE(partial(9, {{2}, {4}}));
  EXPECT_EQ(avatars(), (std::vector<std::uint32_t>{1, 2, 3, 4}));
}

// Rings can have different modes. An avatar that crosses a ring continues in another mode.
TEST_F(WorldViewTest, AnAvatarContinuesInAnotherDetailAfterARing) {
  constexpr auto kReduced = protocol::PoseMode::kCompactReduced;
  constexpr auto kRoot = protocol::PoseMode::kCompactRoot;
  for (std::uint64_t tick = 60; tick <= 63; ++tick) {
    const bool has_crossed = tick >= 62;
    ASSERT_TRUE(Take(tick,
                     has_crossed ? std::vector<test_world::AvatarAt>{{1}, {2}}
                                 : std::vector<test_world::AvatarAt>{{1}},
                     0, kReduced, true));
    if (!has_crossed) {
      ASSERT_TRUE(Take(tick, {{2}}, 0, kRoot, true));
    }
    EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{1, 2}));
  }
  const PoseHistory& history = *view_.Find(2);
  ASSERT_EQ(history.size(), 4u);
  EXPECT_EQ(history.stamp(1).detail, protocol::PoseDetail::kRoot);
  EXPECT_EQ(history.stamp(2).detail, protocol::PoseDetail::kReduced);
  EXPECT_FALSE(history.stamp(2).discontinuity);
  EXPECT_EQ(counts_.missing, 0u);
  EXPECT_EQ(counts_.refused, 0u);
}

TEST_F(WorldViewTest, AnAvatarContinuesOnAnotherShard) {
  ASSERT_TRUE(Take(1, {{1}}, 0));
  ASSERT_TRUE(Take(1, {}, 1));
  ASSERT_TRUE(Take(2, {}, 0));
  ASSERT_TRUE(Take(2, {{1}}, 1));
  ASSERT_TRUE(Take(3, {}, 0));
  EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{1}));
  EXPECT_FALSE(view_.Find(1)->stamp(1).discontinuity);
}

TEST_F(WorldViewTest, ErasesAvatarsThatAreGoneForLong) {
  ASSERT_TRUE(Take(1, {{1}, {2}}));
  const std::size_t two = budget_.used_bytes;
  std::uint64_t tick = 2;
  for (; test_world::TickTime(tick) < 1.0 + WorldView::kKeepGoneS; ++tick)
    ASSERT_TRUE(Take(tick, {{1}}));
  EXPECT_EQ(view_.Find(2), nullptr);
  EXPECT_EQ(budget_.used_bytes, two / 2);
  view_.Clear();
  EXPECT_EQ(budget_.used_bytes, 0u);
}

TEST_F(WorldViewTest, RespectsTheMemoryLimit) {
  budget_.limit_bytes = 5 * PoseHistory::Bytes(8, test_world::kJoints);
  std::vector<test_world::AvatarAt> crowd;
  for (std::uint32_t a = 1; a <= 20; ++a) crowd.push_back({a});
  ASSERT_TRUE(Take(1, crowd));
  ASSERT_TRUE(Take(2, crowd));
  EXPECT_EQ(view_.Avatars().size(), 5u);
  EXPECT_LE(budget_.used_bytes, budget_.limit_bytes);
  EXPECT_EQ(counts_.poses, 10u);
  EXPECT_EQ(counts_.refused, 30u);
}

TEST_F(WorldViewTest, CountsMissingTicks) {
  ASSERT_TRUE(Take(10, {{1}}));
  ASSERT_TRUE(Take(11, {{1}}));
  ASSERT_TRUE(Take(15, {{1}}));
  EXPECT_EQ(counts_.missing, 3u);
}

TEST_F(WorldViewTest, BreakMarksTheNextPoseOfEachAvatar) {
  ASSERT_TRUE(Take(1, {{1}}));
  ASSERT_TRUE(Take(2, {{1}}));
  view_.Break();
  ASSERT_TRUE(Take(9, {{1}}));
  ASSERT_TRUE(Take(10, {{1}}));
  const PoseHistory& history = *view_.Find(1);
  EXPECT_TRUE(history.stamp(0).discontinuity);  // the first pose
  EXPECT_FALSE(history.stamp(1).discontinuity);
  EXPECT_TRUE(history.stamp(2).discontinuity);
  EXPECT_FALSE(history.stamp(3).discontinuity);
  EXPECT_EQ(history.stamp(0).segment, history.stamp(1).segment);
  EXPECT_NE(history.stamp(1).segment, history.stamp(2).segment);
  EXPECT_EQ(history.stamp(2).segment, history.stamp(3).segment);
  EXPECT_EQ(counts_.missing, 0u);  // these ticks were not expected
}

TEST_F(WorldViewTest, KeepsTheDiscontinuityFlag) {
  ASSERT_TRUE(Take(1, {{1}}));
  ASSERT_TRUE(Take(2, {{1, protocol::kPoseDiscontinuity}}));
  ASSERT_TRUE(Take(3, {{1, protocol::kPoseStanding}}));
  EXPECT_TRUE(view_.Find(1)->stamp(1).discontinuity);
  EXPECT_FALSE(view_.Find(1)->stamp(2).discontinuity);
  EXPECT_TRUE(view_.Find(1)->stamp(2).standing);
}

TEST_F(WorldViewTest, StoresPosesOfFilteredAvatarsOnly) {
  ASSERT_TRUE(Take(1, {{1}, {2}, {3}}));
  view_.SetFilter(std::set<std::uint32_t>{2});
  EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{2}));
  ASSERT_TRUE(Take(2, {{1}, {2}, {3}}));
  EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{2}));
  EXPECT_EQ(view_.Find(2)->size(), 2u);
}

protocol::Message Decoded(const std::vector<std::byte>& frame) {
  return protocol::DecodeMessage(protocol::ParseFrame(frame, protocol::Sender::kServer).value())
      .value();
}

TEST_F(WorldViewTest, CompactPosesEqualFullPoses) {
  const protocol::CompactCodecs codecs = test_world::Codecs();
  protocol::PoseRows rows;
  protocol::PoseBatchInfo info{.world = 1, .tick = 1, .mode = protocol::PoseMode::kCompact};
  info.joint_count = test_world::kJoints;
  const std::vector<std::uint32_t> avatars = {1, 2, 3};
  ASSERT_TRUE(rows.Begin(info, std::make_shared<const std::vector<std::uint32_t>>(avatars),
                         codecs.Find(info.mode)));
  std::vector<Quat> pose = test_world::RotationsAt(0.75);
  ASSERT_TRUE(rows.Add(0, Vec3(1.0f), pose));
  pose[1] = YawRotation(1.0);  // outside the range of the compact mode: sent uncompressed
  ASSERT_TRUE(rows.Add(0, Vec3(2.0f), pose));
  pose[1] = kIdentityQuat;
  ASSERT_TRUE(rows.Add(0, Vec3(3.0f), pose));
  std::vector<std::byte> frame;
  ASSERT_TRUE(
      protocol::PoseBatchComposer().Compose(rows, std::vector<std::uint32_t>{0, 1, 2}, {}, frame));
  const protocol::Message message = Decoded(frame);
  const auto& batch = std::get<protocol::PoseBatch>(message);
  view_.SetFilter(std::set<std::uint32_t>{2, 3});
  ASSERT_TRUE(view_.Apply(batch, 1, counts_));
  EXPECT_EQ(view_.Avatars(), (std::vector<std::uint32_t>{2, 3}));
  for (const std::uint32_t avatar : {2u, 3u}) {
    const PoseHistory& history = *view_.Find(avatar);
    EXPECT_EQ(history.root_position_m(0).x, static_cast<float>(avatar));
    EXPECT_LT(AngleBetween(history.rotations(0)[1], avatar == 2 ? YawRotation(1.0) : kIdentityQuat),
              1e-3);
    EXPECT_LT(AngleBetween(history.rotations(0)[2], YawRotation(0.75)), 2e-3);
  }
  // Compact poses of a world without quantizations of rotations are an error.
  protocol::WorldInfo uncoded = test_world::WorldInfo(1, 1, "plaza");
  uncoded.rotation_quantizations.clear();
  uncoded.reduced_joints.clear();
  view_.SetInfo(uncoded);
  const Status status = view_.Apply(batch, 1, counts_);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kUnsupported);
}

TEST_F(WorldViewTest, OmittedJointsHaveTheirReferences) {
  using protocol::PoseDetail;
  std::uint64_t tick = 60;
  for (const PoseDetail detail : {PoseDetail::kAll, PoseDetail::kReduced, PoseDetail::kRoot}) {
    ++tick;
    const auto frame = test_world::PoseFrame(1, tick, {{1}}, protocol::CompactMode(detail));
    const protocol::Message message = Decoded(frame);  // borrows the frame
    ASSERT_TRUE(view_.Apply(std::get<protocol::PoseBatch>(message), 1, counts_));
    const PoseHistory& history = *view_.Find(1);
    const std::size_t newest = history.size() - 1;
    EXPECT_EQ(history.stamp(newest).detail, detail);
    EXPECT_NEAR(history.root_position_m(newest).z, test_world::RootAt(test_world::TickTime(tick)).z,
                1e-3);
    const double turned = AngleBetween(history.rotations(newest)[2], kIdentityQuat);
    if (detail == PoseDetail::kAll) {
      EXPECT_GT(turned, 0.5);
    } else {
      EXPECT_EQ(history.rotations(newest)[2], kIdentityQuat);
    }
  }
}

TEST_F(WorldViewTest, RejectsAnotherSkeletonAndDecreasingTicks) {
  const auto frame = test_world::PoseFrame(1, 1, {{1}}, protocol::PoseMode::kFull, 0, 5);
  const auto message =
      protocol::DecodeMessage(protocol::ParseFrame(frame, protocol::Sender::kServer).value());
  EXPECT_FALSE(view_.Apply(std::get<protocol::PoseBatch>(message.value()), 1, counts_));
  ASSERT_TRUE(Take(5, {{1}}));
  EXPECT_FALSE(Take(4, {{1}}));
}

}  // namespace
}  // namespace stridewire::client
