#include "session/subscriptions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "world/id_set.h"
#include "world/pose_frames.h"

namespace stridewire::server {
namespace {

using protocol::PoseMode;
using testing::ElementsAre;
using Share = Subscriptions::Share;
using Every = PoseInterest::Every;

constexpr WorldId kWorld = 3;

/// A delivery whose rows are of these avatars; of those below 100 there is a pose.
PoseDelivery DeliveryOf(const std::vector<AvatarId>& avatars, std::uint64_t tick = 1,
                        int shard = 0) {
  auto rows = std::make_shared<protocol::PoseRows>();
  EXPECT_TRUE(rows->Begin({kWorld, 0, 0, 1, tick, 0.0, PoseMode::kFull, 1},
                          std::make_shared<const std::vector<AvatarId>>(avatars)));
  for (std::size_t i = 0; i < avatars.size(); ++i) {
    if (avatars[i] >= 100) continue;
    rows->SkipTo(i);
    EXPECT_TRUE(rows->Add(0, Vec3(0.0f), std::array{kIdentityQuat}));
  }
  rows->SkipTo(avatars.size());
  return {.world = kWorld,
          .from_shard = shard,
          .tick = tick,
          .parts = {},
          .rows = rows,
          .places = nullptr};
}

TEST(Subscriptions, WantOfARegionAllModesOfItsRings) {
  Subscriptions all;
  all.SetCompact(true, true);
  EXPECT_TRUE(all.has_detail());
  protocol::Observe asked{.world = kWorld, .mode = PoseMode::kCompactRoot, .every_n_ticks = 12};
  asked.region = protocol::Region{{0.0, 0.0}, 60.0, 4.0, {{8.0, 1}, {20.0, 2}}, {}};
  asked.region->ring_details = {protocol::PoseDetail::kAll, protocol::PoseDetail::kReduced};
  RegionMembers region;
  region.Move(*asked.region, 8.0, asked.every_n_ticks, asked.mode);
  all.Add(
      1,
      {.world = kWorld, .mode = asked.mode, .every_n_ticks = 12, .avatars = {}, .region = region});
  const auto every = [&](PoseMode mode) { return all.EveryOf(kWorld, mode).some; };
  EXPECT_EQ(every(PoseMode::kCompact), 1);
  EXPECT_EQ(every(PoseMode::kCompactReduced), 2);
  EXPECT_EQ(every(PoseMode::kCompactRoot), 12);
  EXPECT_EQ(all.ReachOf(kWorld, PoseMode::kCompactReduced)->beyond_m, 8.0);
  EXPECT_FALSE(all.ReachOf(kWorld, PoseMode::kFull));
  EXPECT_EQ(all.region_count(), 1u);
  PoseDelivery delivery = DeliveryOf({1}, 4);
  for (const auto& [mode, share] : {std::pair(PoseMode::kCompact, Share::kRegion),
                                    std::pair(PoseMode::kCompactReduced, Share::kRegion),
                                    std::pair(PoseMode::kCompactRoot, Share::kNone),  // not due
                                    std::pair(PoseMode::kFull, Share::kNone)}) {
    delivery.mode = mode;
    EXPECT_EQ(all.ShareOf(delivery), share);
  }

  // Another place without the second detail, found by the mode beyond the rings.
  asked.region->ring_details[1] = protocol::PoseDetail::kAll;
  asked.mode = PoseMode::kCompact;
  EXPECT_FALSE(all.MoveRegion(1, asked, 8.0));
  asked.mode = PoseMode::kCompactRoot;
  EXPECT_TRUE(all.MoveRegion(1, asked, 8.0));
  EXPECT_EQ(every(PoseMode::kCompact), 1);
  EXPECT_FALSE(all.Watches(kWorld, PoseMode::kCompactReduced));
  // Resumed by a client that knows of no details, then of no compact poses.
  all.SetCompact(true, false);
  EXPECT_FALSE(all.has_detail());
  EXPECT_EQ(every(PoseMode::kCompact), 1);
  EXPECT_EQ(every(PoseMode::kCompactRoot), 0);
  all.SetCompact(false, false);
  EXPECT_EQ(every(PoseMode::kQuantised), 1);
  EXPECT_EQ(every(PoseMode::kCompact), 0);
  EXPECT_TRUE(all.Remove(1).has_value());
  EXPECT_FALSE(all.WatchesWorld(kWorld));
}

TEST(Subscriptions, WantTheUnionOfWhatTheyNameUnlessOneIsAboutAll) {
  Subscriptions all;
  all.Add(1, {.world = kWorld, .every_n_ticks = 4, .avatars = {5, 1, 5}});
  all.Add(2, {.world = kWorld, .every_n_ticks = 6, .avatars = {2, 5}});
  all.Add(3, {.world = kWorld, .mode = PoseMode::kQuantised, .avatars = {9}});
  all.Add(4, {.world = kWorld + 1, .avatars = {8}});
  EXPECT_THAT(all.Named(kWorld, PoseMode::kFull), ElementsAre(1, 2, 5));
  EXPECT_EQ(all.EveryOf(kWorld, PoseMode::kFull), (Every{0, 2}));
  EXPECT_EQ(all.named_count(), 6u);
  EXPECT_EQ(all.ShareOf(DeliveryOf({1}, 4)), Share::kSome);
  EXPECT_EQ(all.ShareOf(DeliveryOf({1}, 6)), Share::kSome);
  EXPECT_EQ(all.ShareOf(DeliveryOf({1}, 2)), Share::kNone);

  all.Add(5, {.world = kWorld, .every_n_ticks = 3, .avatars = {}});
  EXPECT_THAT(all.Named(kWorld, PoseMode::kFull), ElementsAre());
  EXPECT_EQ(all.EveryOf(kWorld, PoseMode::kFull), (Every{1, 0}));
  EXPECT_EQ(all.ShareOf(DeliveryOf({1}, 4)), Share::kWhole);

  EXPECT_TRUE(all.Remove(5).has_value());
  EXPECT_FALSE(all.Remove(5).has_value());
  EXPECT_TRUE(all.Remove(1).has_value());
  EXPECT_THAT(all.Named(kWorld, PoseMode::kFull), ElementsAre(2, 5));
  all.RemoveWorld(kWorld);
  EXPECT_FALSE(all.Watches(kWorld, PoseMode::kFull));
  EXPECT_TRUE(all.Watches(kWorld + 1, PoseMode::kFull));
  EXPECT_EQ(all.named_count(), 1u);
}

TEST(Subscriptions, PickTheRowsOfThoseNamed) {
  Subscriptions all;
  all.Add(1, {.world = kWorld, .avatars = {7, 2, 50, 90}});
  EXPECT_THAT(*all.Pick(DeliveryOf({1, 2, 3, 7, 90})), ElementsAre(1, 3, 4));
  // Another order, and others.
  EXPECT_THAT(*all.Pick(DeliveryOf({7, 8, 50})), ElementsAre(0, 2));
  all.Add(2, {.world = kWorld, .avatars = {8}});
  EXPECT_THAT(*all.Pick(DeliveryOf({7, 8, 50})), ElementsAre(0, 1, 2));
}

// Who was in a shard's last batch and is in none any more has to be told by an empty one.
TEST(Subscriptions, TellOnceThatNoneIsThere) {
  Subscriptions all;
  all.Add(1, {.world = kWorld, .avatars = {2, 200}});
  EXPECT_TRUE(all.Pick(DeliveryOf({1})).has_value());  // the first: the client may have had others
  EXPECT_FALSE(all.Pick(DeliveryOf({1})).has_value());
  EXPECT_TRUE(all.Pick(DeliveryOf({200}, 1, 1)).has_value());  // another shard; a row without pose
  EXPECT_FALSE(all.Pick(DeliveryOf({200}, 1, 1)).has_value());
  EXPECT_THAT(*all.Pick(DeliveryOf({1, 2})), ElementsAre(1));
  EXPECT_THAT(*all.Pick(DeliveryOf({1})), ElementsAre());
  EXPECT_FALSE(all.Pick(DeliveryOf({1})).has_value());
  all.TellAnew();
  EXPECT_TRUE(all.Pick(DeliveryOf({1})).has_value());
  EXPECT_FALSE(all.Pick(DeliveryOf({1})).has_value());
}

TEST(IdSet, HasEachNumberOnceInOrder) {
  IdSet numbers;
  EXPECT_TRUE(numbers.Take().empty());
  numbers.Add(std::vector<AvatarId>{64, 3, ~AvatarId{0}});
  numbers.Add(std::vector<AvatarId>{1u << 20, 63, 3, (1u << 20) - 1, 0, ~AvatarId{0}});
  EXPECT_THAT(numbers.Take(),
              ElementsAre(0, 3, 63, 64, (1u << 20) - 1, 1u << 20, ~AvatarId{0}));
  EXPECT_TRUE(numbers.Take().empty());
}

TEST(RowsPool, NeverFillsRowsThatAreRead) {
  RowsPool pool;
  std::vector<std::shared_ptr<const protocol::PoseRows>> read;
  for (int i = 0; i < 6; ++i) {
    const protocol::PoseRows* rows = &pool.Take();
    for (const auto& other : read) EXPECT_NE(other.get(), rows);
    read.push_back(pool.Share());
    EXPECT_EQ(read.back().get(), rows);
  }
  const protocol::PoseRows* first = read.front().get();
  read.clear();
  EXPECT_EQ(&pool.Take(), first);  // with its memory
}

}  // namespace
}  // namespace stridewire::server
