// Compares RegionMembers with a brute-force search.
#include "session/region_members.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>
#include <set>

#include "random.h"

namespace stridewire::server {
namespace {

using protocol::PoseMode;
using testing::ElementsAre;

/// A delivery of avatars at given positions. Avatars in `without` have no pose.
PoseDelivery DeliveryAt(const std::map<AvatarId, std::pair<float, float>>& at, std::uint64_t tick,
                        int shard = 0, const std::set<AvatarId>& without = {},
                        double cell_m = 8.0) {
  auto rows = std::make_shared<protocol::PoseRows>();
  auto grid = std::make_shared<SpatialGrid>();
  std::vector<AvatarId> numbers;
  for (const auto& [id, position] : at) numbers.push_back(id);
  EXPECT_TRUE(rows->Begin({1, 0, 0, 1, tick, 0.0, protocol::PoseMode::kFull, 1},
                          std::make_shared<const std::vector<AvatarId>>(numbers)));
  grid->Begin(cell_m, numbers.size());
  for (std::size_t row = 0; row < numbers.size(); ++row) {
    const auto& [x, z] = at.at(numbers[row]);
    grid->Add(static_cast<std::uint32_t>(row), x, z);
    if (without.contains(numbers[row])) continue;
    rows->SkipTo(row);
    EXPECT_TRUE(rows->Add(0, Vec3(x, 0.0f, z), std::array{kIdentityQuat}));
  }
  rows->SkipTo(numbers.size());
  grid->Sort();
  return {.world = 1,
          .from_shard = shard,
          .tick = tick,
          .parts = {},
          .rows = std::move(rows),
          .grid = std::move(grid)};
}

std::vector<AvatarId> IdsOfRows(const PoseDelivery& delivery, std::span<const std::uint32_t> rows) {
  std::vector<AvatarId> numbers;
  for (const std::uint32_t row : rows) numbers.push_back((*delivery.rows->avatars())[row]);
  return numbers;
}

TEST(SpatialGrid, FindsAllNearAPointWithAnyCellSize) {
  const unsigned seed = std::random_device{}();
  std::cout << "seed " << seed << "\n";
  Random random(seed);
  for (const double cell_m : {1.0, 8.0, 1000.0}) {
    SpatialGrid grid;
    grid.Begin(cell_m, 300);
    std::vector<std::pair<float, float>> at;
    for (std::uint32_t row = 0; row < 300; ++row) {
      const double scale = row % 10 == 0 ? 100'000.0 : 40.0;
      at.emplace_back(static_cast<float>(random.Draw(-scale, scale)),
                      static_cast<float>(random.Draw(-scale, scale)));
      grid.Add(row, at.back().first, at.back().second);
    }
    grid.Sort();
    for (int i = 0; i < 200; ++i) {
      const double x = random.Draw(-60.0, 60.0);
      const double z = random.Draw(-60.0, 60.0);
      const double reach_m = i % 20 == 0 ? 1e300 : random.Draw(0.0, i % 3 == 0 ? 1e5 : 30.0);
      std::set<std::uint32_t> expected;
      for (std::uint32_t row = 0; row < at.size(); ++row) {
        if (std::abs(at[row].first - x) <= reach_m && std::abs(at[row].second - z) <= reach_m) {
          expected.insert(row);
        }
      }
      std::multiset<std::uint32_t> found;
      grid.ForEachNear(x, z, reach_m, [&](std::uint32_t row, float, float) { found.insert(row); });
      ASSERT_EQ(std::vector(found.begin(), found.end()),
                std::vector(expected.begin(), expected.end()));
    }
    int found = 0;
    grid.ForEachNear(1e300, -1e300, 10.0, [&](std::uint32_t, float, float) { ++found; });
    EXPECT_EQ(found, 0);
  }
}

// Avatars walk, appear and disappear on two shards while the region moves and changes.
TEST(RegionMembers, MatchABruteForceSearch) {
  const unsigned seed = std::random_device{}();
  std::cout << "seed " << seed << "\n";
  Random random(seed);
  RegionMembers members;
  protocol::Region region{{0.0, 0.0}, 20.0, 5.0, {{10.0, 1}, {18.0, 3}}};
  constexpr std::uint16_t kEvery = 4;
  members.Set(region, 8.0, kEvery, PoseMode::kFull);
  EXPECT_EQ(members.interval(PoseMode::kFull), 1);
  std::map<AvatarId, std::pair<float, float>> at[2];
  std::set<AvatarId> inside;
  std::size_t entered_count = 0;
  std::size_t left_count = 0;
  for (std::uint64_t tick = 1; tick <= 600; ++tick) {
    if (tick % 7 == 0) {
      region.centre_m.x += random.Draw(-4.0, 4.0);
      region.centre_m.z += random.Draw(-4.0, 4.0);
      region.radius_m = random.Draw(12.0, 25.0);
      region.leave_m = tick % 14 == 0 ? std::nullopt : std::optional(random.Draw(0.0, 10.0));
      members.Set(region, 8.0, kEvery, PoseMode::kFull);
    }
    const double leave_at_m = region.radius_m + region.leave_m.value_or(8.0);
    for (int shard = 0; shard < 2; ++shard) {
      for (AvatarId number = 1 + static_cast<AvatarId>(shard); number <= 60; number += 2) {
        const auto found = at[shard].find(number);
        if (found == at[shard].end()) {
          if (random.Draw(0.0, 1.0) < 0.2) {
            at[shard][number] = {static_cast<float>(random.Draw(-40.0, 40.0)),
                                 static_cast<float>(random.Draw(-40.0, 40.0))};
          }
        } else if (random.Draw(0.0, 1.0) < 0.01) {
          at[shard].erase(found);
        } else {
          found->second.first += static_cast<float>(random.Draw(-1.0, 1.0));
          found->second.second += static_cast<float>(random.Draw(-1.0, 1.0));
        }
      }
      const PoseDelivery delivery = DeliveryAt(at[shard], tick, shard);
      const RegionMembers::Change change = members.Update(delivery);
      std::vector<AvatarId> entered;
      std::vector<AvatarId> left;
      std::vector<AvatarId> due;
      for (AvatarId number = 1 + static_cast<AvatarId>(shard); number <= 60; number += 2) {
        const auto found = at[shard].find(number);
        const bool was = inside.contains(number);
        bool is = false;
        if (found != at[shard].end()) {
          const double distance_m = std::hypot(found->second.first - region.centre_m.x,
                                               found->second.second - region.centre_m.z);
          is = distance_m <= (was ? leave_at_m : region.radius_m);
          const std::uint64_t every = distance_m <= 10.0 ? 1 : distance_m <= 18.0 ? 3 : kEvery;
          if (is && (!was || tick % every == 0)) due.push_back(number);
        }
        if (is && !was) entered.push_back(number);
        if (was && !is) left.push_back(number);
        if (is) {
          inside.insert(number);
        } else {
          inside.erase(number);
        }
      }
      ASSERT_TRUE(std::ranges::equal(change.entered, entered)) << tick;
      ASSERT_TRUE(std::ranges::equal(change.left, left)) << tick;
      ASSERT_EQ(IdsOfRows(delivery, change.due), due) << tick;
      entered_count += entered.size();
      left_count += left.size();
    }
  }
  EXPECT_GT(entered_count, 50u);
  EXPECT_GT(left_count, 50u);
}

// As above, with rings of different detail. Each mode has its own deliveries, which contain only
// the poses that the filter of this mode selects.
TEST(RegionMembers, AreDueInTheModeOfTheirRing) {
  const unsigned seed = std::random_device{}();
  std::cout << "seed " << seed << "\n";
  Random random(seed);
  RegionMembers members;
  protocol::Region region{{0.0, 0.0}, 24.0, 5.0, {{6.0, 2}, {12.0, 3}, {18.0, 6}}, {}};
  using protocol::PoseDetail;
  region.ring_details = {PoseDetail::kAll, PoseDetail::kReduced, PoseDetail::kAll};
  members.Set(region, 8.0, 4, PoseMode::kCompactRoot);
  EXPECT_THAT(members.modes(),
              testing::UnorderedElementsAre(PoseMode::kCompact, PoseMode::kCompactReduced,
                                            PoseMode::kCompactRoot));
  EXPECT_EQ(members.interval(PoseMode::kCompact), 2);
  EXPECT_EQ(members.interval(PoseMode::kCompactReduced), 3);
  EXPECT_EQ(members.interval(PoseMode::kCompactRoot), 4);
  EXPECT_EQ(members.interval(PoseMode::kQuantised), 0);
  EXPECT_EQ(members.filter(PoseMode::kCompact), (RegionFilter{0.0, 0.0, 18.0, 0.0, true}));
  EXPECT_EQ(members.filter(PoseMode::kCompactReduced), (RegionFilter{0.0, 0.0, 12.0, 6.0, true}));
  EXPECT_EQ(members.filter(PoseMode::kCompactRoot), (RegionFilter{0.0, 0.0, 29.0, 18.0, true}));

  std::map<AvatarId, std::pair<float, float>> at;
  std::set<AvatarId> inside;
  std::map<AvatarId, PoseMode> last_mode;
  int crossed = 0;
  int left_count = 0;
  for (std::uint64_t tick = 1; tick <= 900; ++tick) {
    for (AvatarId number = 1; number <= 60; ++number) {
      const auto found = at.find(number);
      if (found == at.end()) {
        at[number] = {static_cast<float>(random.Draw(-40.0, 40.0)),
                      static_cast<float>(random.Draw(-40.0, 40.0))};
      } else if (random.Draw(0.0, 1.0) < 0.01) {
        at.erase(found);
      } else {
        found->second.first += static_cast<float>(random.Draw(-1.0, 1.0));
        found->second.second += static_cast<float>(random.Draw(-1.0, 1.0));
      }
    }
    if (tick % 50 == 0) {
      region.centre_m.x += random.Draw(-4.0, 4.0);
      members.Set(region, 8.0, 4, PoseMode::kCompactRoot);
    }
    const auto distance_of = [&](AvatarId number) {
      return std::hypot(at.at(number).first - region.centre_m.x,
                        at.at(number).second - region.centre_m.z);
    };
    for (const PoseMode mode :
         {PoseMode::kCompact, PoseMode::kCompactReduced, PoseMode::kCompactRoot}) {
      if (tick % members.interval(mode) != 0) continue;
      const RegionFilter filter = members.filter(mode);
      std::set<AvatarId> without;
      for (const auto& [id, position] : at) {
        const double distance_m = distance_of(id);
        if (distance_m > filter.outer_m || (filter.inner_m > 0.0 && distance_m <= filter.inner_m)) {
          without.insert(id);
        }
      }
      PoseDelivery delivery = DeliveryAt(at, tick, 0, without);
      delivery.mode = mode;
      const RegionMembers::Change change = members.Update(delivery);
      std::vector<AvatarId> entered;
      std::vector<AvatarId> left;
      std::vector<AvatarId> due;
      for (AvatarId number = 1; number <= 60; ++number) {
        const bool was = inside.contains(number);
        const double distance_m = at.contains(number) ? distance_of(number) : 1e9;
        const auto [every, of] = distance_m <= 6.0    ? std::pair(2u, PoseMode::kCompact)
                                 : distance_m <= 12.0 ? std::pair(3u, PoseMode::kCompactReduced)
                                 : distance_m <= 18.0 ? std::pair(6u, PoseMode::kCompact)
                                                      : std::pair(4u, PoseMode::kCompactRoot);
        if (was && distance_m > 29.0) left.push_back(number);
        const bool enters = !was && distance_m <= 24.0 && of == mode;
        if (enters) entered.push_back(number);
        if (of == mode && (enters || (was && distance_m <= 29.0 && tick % every == 0))) {
          due.push_back(number);
          const auto before = last_mode.find(number);
          crossed += was && before != last_mode.end() && before->second != mode;
          last_mode[number] = mode;
        }
      }
      for (const AvatarId number : left) {
        inside.erase(number);
        last_mode.erase(number);
      }
      inside.insert(entered.begin(), entered.end());
      left_count += static_cast<int>(left.size());
      ASSERT_TRUE(std::ranges::equal(change.entered, entered)) << tick;
      ASSERT_TRUE(std::ranges::equal(change.left, left)) << tick;
      ASSERT_EQ(IdsOfRows(delivery, change.due), due) << tick;
    }
  }
  EXPECT_GT(crossed, 50);
  EXPECT_GT(left_count, 50);
}

TEST(RegionMembers, OfOneModeHaveOneFilterForTheRegion) {
  RegionMembers members;
  protocol::Region region{{1.0, 2.0}, 20.0, 5.0, {{6.0, 2}}, {}};
  members.Set(region, 8.0, 4, PoseMode::kCompact);
  const RegionFilter region_filter{1.0, 2.0, 25.0, 0.0, false};
  EXPECT_EQ(members.filter(PoseMode::kCompact), region_filter);
  region.ring_details = {protocol::PoseDetail::kAll};
  members.Set(region, 8.0, 4, PoseMode::kCompactRoot);
  EXPECT_NE(members.filter(PoseMode::kCompactRoot), region_filter);
}

TEST(RegionMembers, EnterWithTheirFirstPose) {
  RegionMembers members;
  members.Set({{0.0, 0.0}, 10.0, 0.0, {}, {}}, 8.0, 1, PoseMode::kFull);
  const std::map<AvatarId, std::pair<float, float>> at{{4, {1.0f, 1.0f}}, {5, {2.0f, 0.0f}}};
  PoseDelivery delivery = DeliveryAt(at, 1, 0, {5});
  RegionMembers::Change change = members.Update(delivery);
  EXPECT_THAT(std::vector(change.entered.begin(), change.entered.end()), ElementsAre(4));
  delivery = DeliveryAt(at, 2, 0, {4});
  change = members.Update(delivery);
  EXPECT_THAT(std::vector(change.entered.begin(), change.entered.end()), ElementsAre(5));
  EXPECT_TRUE(change.left.empty());  // 4 is still inside, although it has no pose in this delivery
  EXPECT_THAT(IdsOfRows(delivery, change.due), ElementsAre(5));
}

}  // namespace
}  // namespace stridewire::server
