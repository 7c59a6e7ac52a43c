#include "session/movement_feed.h"

#include <gmock/gmock.h>

#include <numeric>

namespace stridewire::server {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// A step in which some avatars have a record of as many bytes as their number.
protocol::Movements StepOf(const std::vector<AvatarId>& avatars) {
  protocol::Movements step{.world = 4, .shard = 1, .part = 2, .parts = 3, .step = 5, .tick = 6};
  for (const AvatarId number : avatars) {
    step.avatars.push_back(number);
    step.flags.push_back(protocol::kPoseDiscontinuity);
    step.records.resize(step.records.size() + number, static_cast<std::byte>(number));
    step.ends.push_back(static_cast<std::uint32_t>(step.records.size()));
  }
  return step;
}

/// Whose states it asks for; empty: it asks for none, or for all (`is_all`).
std::vector<AvatarId> Asked(MovementFeed& feed, AvatarId next = 0, bool* is_all = nullptr) {
  static std::uint32_t nonce = 0;
  if (!feed.asks()) return {};
  StatesQuestion question;
  feed.Ask(++nonce, question);
  EXPECT_FALSE(feed.asks());
  EXPECT_FALSE(feed.OnStates({.nonce = nonce + 1, .frame = nullptr}));
  EXPECT_TRUE(feed.OnStates({.nonce = nonce, .next = next, .frame = nullptr}));
  if (is_all != nullptr) *is_all = question.named == nullptr;
  if (question.named == nullptr) return {};
  const auto from = std::ranges::lower_bound(*question.named, question.first);
  return {from, question.named->end()};
}

TEST(MovementFeed, TellsOfThoseNamed) {
  MovementFeed feed(nullptr);
  feed.Watch({{3, 7, 9}});
  EXPECT_FALSE(feed.is_whole());
  EXPECT_THAT(Asked(feed), ElementsAre(3, 7, 9));
  const protocol::Movements some = feed.Pick(StepOf({1, 3, 4, 9, 10}), 1 << 20);
  EXPECT_EQ(some, StepOf({3, 9}));
  EXPECT_THAT(feed.Pick(StepOf({8}), 1 << 20).avatars, IsEmpty());
}

TEST(MovementFeed, AsksForTheStatesOfNewOnesAlone) {
  MovementFeed feed(nullptr);
  feed.Watch({{3, 7}});
  EXPECT_THAT(Asked(feed), ElementsAre(3, 7));
  feed.Watch({{3, 5, 7, 8}});
  EXPECT_THAT(Asked(feed, /*next=*/8), ElementsAre(5, 8));
  // 8 was not told yet.
  feed.Watch({{2, 3, 7, 8}});
  EXPECT_THAT(Asked(feed), ElementsAre(2, 8));
  feed.Watch({{2, 3}});
  EXPECT_FALSE(feed.asks());
}

TEST(MovementFeed, WhoIsNotToldOfAnyMoreIsGone) {
  MovementFeed feed(nullptr);
  feed.Watch({{3, 7, 9}});
  feed.Watch({{9}});
  feed.Watch({{7, 9}});  // 7 is told of all the time
  const protocol::Movements some = feed.Pick(StepOf({3, 7}), 1 << 20);
  EXPECT_THAT(some.avatars, ElementsAre(3, 7));
  EXPECT_THAT(some.flags, ElementsAre(protocol::kMovementGone, protocol::kPoseDiscontinuity));
  EXPECT_THAT(some.ends, ElementsAre(0, 7));
  EXPECT_THAT(feed.Pick(StepOf({3}), 1 << 20).avatars, IsEmpty());
}

TEST(MovementFeed, TellsOfNoMoreThanFits) {
  MovementFeed feed(nullptr);
  std::vector<AvatarId> many(2000);
  std::iota(many.begin(), many.end(), 1u);
  feed.Watch(many);
  feed.Watch({{}});
  std::vector<AvatarId> gone;
  int steps = 0;
  for (; gone.size() < many.size() && steps < 100; ++steps) {
    const protocol::Movements some = feed.Pick(StepOf({5, 6}), 4096);
    ASSERT_LE(some.avatars.size() * 9 + some.records.size(), 4096u);
    gone.insert(gone.end(), some.avatars.begin(), some.avatars.end());
  }
  EXPECT_EQ(gone, many);
  EXPECT_GT(steps, 3);
}

TEST(MovementFeed, WhatWasAboutAllStaysSo) {
  MovementFeed feed(nullptr);
  feed.Watch(std::nullopt);
  bool is_all = false;
  (void)Asked(feed, 0, &is_all);
  EXPECT_TRUE(is_all);
  feed.Watch({{3}});
  EXPECT_TRUE(feed.is_whole());
}

TEST(MovementFeed, GoesOnFromNewStatesOfAllItIsAbout) {
  MovementFeed feed(nullptr);
  feed.Watch({{3, 7}});
  (void)Asked(feed);
  feed.Watch({{7}});
  feed.Lose();
  EXPECT_TRUE(feed.is_lost());
  EXPECT_FALSE(feed.asks());
  feed.Recover();
  EXPECT_THAT(Asked(feed), ElementsAre(7));
  EXPECT_THAT(feed.Pick(StepOf({3}), 1 << 20).avatars, IsEmpty());  // the gap has said so
}

}  // namespace
}  // namespace stridewire::server
