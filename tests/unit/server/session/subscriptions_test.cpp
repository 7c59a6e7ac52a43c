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

constexpr WorldId kWorld = 3;

/// A delivery with one row per avatar. Avatars with ids below 100 have a pose.
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
          .grid = nullptr};
}

TEST(Subscriptions, ObserveAllModesOfTheRingsOfARegion) {
  Subscriptions all;
  protocol::Observe observe{.world = kWorld, .mode = PoseMode::kCompactRoot, .every_n_ticks = 12};
  observe.region = protocol::Region{{0.0, 0.0}, 60.0, 4.0, {{8.0, 1}, {20.0, 2}}, {}};
  observe.region->ring_details = {protocol::PoseDetail::kAll, protocol::PoseDetail::kReduced};
  RegionMembers region;
  region.Set(*observe.region, 8.0, observe.every_n_ticks, observe.mode);
  all.Add(1, {.world = kWorld,
              .mode = observe.mode,
              .every_n_ticks = 12,
              .avatars = {},
              .region = region});
  const auto interval = [&](PoseMode mode) { return all.IntervalOf(kWorld, mode).subset; };
  EXPECT_EQ(interval(PoseMode::kCompact), 1);
  EXPECT_EQ(interval(PoseMode::kCompactReduced), 2);
  EXPECT_EQ(interval(PoseMode::kCompactRoot), 12);
  EXPECT_EQ(all.FilterOf(kWorld, PoseMode::kCompactReduced)->inner_m, 8.0);
  EXPECT_FALSE(all.FilterOf(kWorld, PoseMode::kFull));
  EXPECT_EQ(all.region_count(), 1u);
  PoseDelivery delivery = DeliveryOf({1}, 4);
  for (const auto& [mode, share] : {std::pair(PoseMode::kCompact, Share::kRegion),
                                    std::pair(PoseMode::kCompactReduced, Share::kRegion),
                                    std::pair(PoseMode::kCompactRoot, Share::kNone),  // not due
                                    std::pair(PoseMode::kFull, Share::kNone)}) {
    delivery.mode = mode;
    EXPECT_EQ(all.ShareOf(delivery), share);
  }

  // Move the region and remove the second detail. The mode beyond the rings must stay the same.
  observe.region->ring_details[1] = protocol::PoseDetail::kAll;
  observe.mode = PoseMode::kCompact;
  EXPECT_FALSE(all.MoveRegion(1, observe, 8.0));
  observe.mode = PoseMode::kCompactRoot;
  EXPECT_TRUE(all.MoveRegion(1, observe, 8.0));
  EXPECT_EQ(interval(PoseMode::kCompact), 1);
  EXPECT_FALSE(all.Observes(kWorld, PoseMode::kCompactReduced));
  EXPECT_TRUE(all.Remove(1).has_value());
  EXPECT_FALSE(all.ObservesWorld(kWorld));
}

TEST(Subscriptions, ShareTheUnionOfTheirAvatarsUnlessOneCoversAll) {
  Subscriptions all;
  all.Add(1, {.world = kWorld, .every_n_ticks = 4, .avatars = {5, 1, 5}});
  all.Add(2, {.world = kWorld, .every_n_ticks = 6, .avatars = {2, 5}});
  all.Add(3, {.world = kWorld, .mode = PoseMode::kQuantised, .avatars = {9}});
  all.Add(4, {.world = kWorld + 1, .avatars = {8}});
  EXPECT_THAT(all.SelectedAvatars(kWorld, PoseMode::kFull), ElementsAre(1, 2, 5));
  EXPECT_EQ(all.IntervalOf(kWorld, PoseMode::kFull), (SendInterval{0, 2}));
  EXPECT_EQ(all.selected_count(), 6u);
  EXPECT_EQ(all.ShareOf(DeliveryOf({1}, 4)), Share::kSubset);
  EXPECT_EQ(all.ShareOf(DeliveryOf({1}, 6)), Share::kSubset);
  EXPECT_EQ(all.ShareOf(DeliveryOf({1}, 2)), Share::kNone);

  all.Add(5, {.world = kWorld, .every_n_ticks = 3, .avatars = {}});
  EXPECT_THAT(all.SelectedAvatars(kWorld, PoseMode::kFull), ElementsAre());
  EXPECT_EQ(all.IntervalOf(kWorld, PoseMode::kFull), (SendInterval{1, 0}));
  EXPECT_EQ(all.ShareOf(DeliveryOf({1}, 4)), Share::kAll);

  EXPECT_TRUE(all.Remove(5).has_value());
  EXPECT_FALSE(all.Remove(5).has_value());
  EXPECT_TRUE(all.Remove(1).has_value());
  EXPECT_THAT(all.SelectedAvatars(kWorld, PoseMode::kFull), ElementsAre(2, 5));
  all.RemoveWorld(kWorld);
  EXPECT_FALSE(all.Observes(kWorld, PoseMode::kFull));
  EXPECT_TRUE(all.Observes(kWorld + 1, PoseMode::kFull));
  EXPECT_EQ(all.selected_count(), 1u);
}

TEST(Subscriptions, PickTheRowsOfSelectedAvatars) {
  Subscriptions all;
  all.Add(1, {.world = kWorld, .avatars = {7, 2, 50, 90}});
  EXPECT_THAT(*all.PickRows(DeliveryOf({1, 2, 3, 7, 90})), ElementsAre(1, 3, 4));
  // The order and the avatars have changed.
  EXPECT_THAT(*all.PickRows(DeliveryOf({7, 8, 50})), ElementsAre(0, 2));
  all.Add(2, {.world = kWorld, .avatars = {8}});
  EXPECT_THAT(*all.PickRows(DeliveryOf({7, 8, 50})), ElementsAre(0, 1, 2));
}

// When no avatar has a pose any more, the client must receive one empty batch.
TEST(Subscriptions, SendOneEmptyBatch) {
  Subscriptions all;
  all.Add(1, {.world = kWorld, .avatars = {2, 200}});
  EXPECT_TRUE(all.PickRows(DeliveryOf({1}))
                  .has_value());  // the first delivery: the client may have had poses before
  EXPECT_FALSE(all.PickRows(DeliveryOf({1})).has_value());
  EXPECT_TRUE(
      all.PickRows(DeliveryOf({200}, 1, 1)).has_value());  // another shard, with a row without pose
  EXPECT_FALSE(all.PickRows(DeliveryOf({200}, 1, 1)).has_value());
  EXPECT_THAT(*all.PickRows(DeliveryOf({1, 2})), ElementsAre(1));
  EXPECT_THAT(*all.PickRows(DeliveryOf({1})), ElementsAre());
  EXPECT_FALSE(all.PickRows(DeliveryOf({1})).has_value());
  all.RepeatEmptyBatches();
  EXPECT_TRUE(all.PickRows(DeliveryOf({1})).has_value());
  EXPECT_FALSE(all.PickRows(DeliveryOf({1})).has_value());
}

TEST(IdSet, ReturnsEachIdOnceInOrder) {
  IdSet ids;
  EXPECT_TRUE(ids.Take().empty());
  ids.Add(std::vector<AvatarId>{64, 3, ~AvatarId{0}});
  ids.Add(std::vector<AvatarId>{1u << 20, 63, 3, (1u << 20) - 1, 0, ~AvatarId{0}});
  EXPECT_THAT(ids.Take(), ElementsAre(0, 3, 63, 64, (1u << 20) - 1, 1u << 20, ~AvatarId{0}));
  EXPECT_TRUE(ids.Take().empty());
}

TEST(RowsPool, NeverReusesRowsThatAreInUse) {
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
  EXPECT_EQ(&pool.Take(), first);  // its memory is reused
}

}  // namespace
}  // namespace stridewire::server
