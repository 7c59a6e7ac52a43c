#include "session/movement_feed.h"

#include <gmock/gmock.h>

#include <numeric>

namespace stridewire::server {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// A step with movements of some avatars. The record of an avatar has as many bytes as its id.
protocol::Movements StepOf(const std::vector<AvatarId>& avatars) {
  protocol::Movements step{.world = 4, .shard = 1, .part = 2, .parts = 3, .step = 5, .tick = 6};
  for (const AvatarId id : avatars) {
    step.avatars.push_back(id);
    step.flags.push_back(protocol::kPoseDiscontinuity);
    step.records.resize(step.records.size() + id, static_cast<std::byte>(id));
    step.ends.push_back(static_cast<std::uint32_t>(step.records.size()));
  }
  return step;
}

/// Makes the next request for states and answers it. Returns the requested avatars: none if no
/// request is needed, or if the states of all avatars are requested (`is_all`).
std::vector<AvatarId> Request(MovementFeed& feed, AvatarId next = 0, bool* is_all = nullptr) {
  static std::uint32_t nonce = 0;
  if (!feed.needs_request()) return {};
  StatesRequest request;
  feed.NextRequest(++nonce, request);
  EXPECT_FALSE(feed.needs_request());
  EXPECT_FALSE(feed.OnStates({.nonce = nonce + 1, .frame = nullptr}));
  EXPECT_TRUE(feed.OnStates({.nonce = nonce, .next = next, .frame = nullptr}));
  if (is_all != nullptr) *is_all = request.avatars == nullptr;
  if (request.avatars == nullptr) return {};
  const auto from = std::ranges::lower_bound(*request.avatars, request.first);
  return {from, request.avatars->end()};
}

TEST(MovementFeed, SelectsMovementsOfSelectedAvatars) {
  MovementFeed feed(nullptr);
  feed.SetAvatars({{3, 7, 9}});
  EXPECT_FALSE(feed.covers_all());
  EXPECT_THAT(Request(feed), ElementsAre(3, 7, 9));
  const protocol::Movements some = feed.Select(StepOf({1, 3, 4, 9, 10}), 1 << 20);
  EXPECT_EQ(some, StepOf({3, 9}));
  EXPECT_THAT(feed.Select(StepOf({8}), 1 << 20).avatars, IsEmpty());
}

TEST(MovementFeed, RequestsOnlyMissingStates) {
  MovementFeed feed(nullptr);
  feed.SetAvatars({{3, 7}});
  EXPECT_THAT(Request(feed), ElementsAre(3, 7));
  feed.SetAvatars({{3, 5, 7, 8}});
  EXPECT_THAT(Request(feed, /*next=*/8), ElementsAre(5, 8));
  // The state of 8 was not sent yet.
  feed.SetAvatars({{2, 3, 7, 8}});
  EXPECT_THAT(Request(feed), ElementsAre(2, 8));
  feed.SetAvatars({{2, 3}});
  EXPECT_FALSE(feed.needs_request());
}

TEST(MovementFeed, ReportsDeselectedAvatarsAsGone) {
  MovementFeed feed(nullptr);
  feed.SetAvatars({{3, 7, 9}});
  feed.SetAvatars({{9}});
  feed.SetAvatars({{7, 9}});  // 7 was not reported as gone, so it stays valid
  const protocol::Movements some = feed.Select(StepOf({3, 7}), 1 << 20);
  EXPECT_THAT(some.avatars, ElementsAre(3, 7));
  EXPECT_THAT(some.flags, ElementsAre(protocol::kMovementGone, protocol::kPoseDiscontinuity));
  EXPECT_THAT(some.ends, ElementsAre(0, 7));
  EXPECT_THAT(feed.Select(StepOf({3}), 1 << 20).avatars, IsEmpty());
}

TEST(MovementFeed, SpreadsGoneAvatarsOverSteps) {
  MovementFeed feed(nullptr);
  std::vector<AvatarId> many(2000);
  std::iota(many.begin(), many.end(), 1u);
  feed.SetAvatars(many);
  feed.SetAvatars({{}});
  std::vector<AvatarId> gone;
  int steps = 0;
  for (; gone.size() < many.size() && steps < 100; ++steps) {
    const protocol::Movements some = feed.Select(StepOf({5, 6}), 4096);
    ASSERT_LE(some.avatars.size() * 9 + some.records.size(), 4096u);
    gone.insert(gone.end(), some.avatars.begin(), some.avatars.end());
  }
  EXPECT_EQ(gone, many);
  EXPECT_GT(steps, 3);
}

TEST(MovementFeed, StaysWithAllAvatars) {
  MovementFeed feed(nullptr);
  feed.SetAvatars(std::nullopt);
  bool is_all = false;
  (void)Request(feed, 0, &is_all);
  EXPECT_TRUE(is_all);
  feed.SetAvatars({{3}});
  EXPECT_TRUE(feed.covers_all());
}

TEST(MovementFeed, RestartsWithAllStatesAfterLoss) {
  MovementFeed feed(nullptr);
  feed.SetAvatars({{3, 7}});
  (void)Request(feed);
  feed.SetAvatars({{7}});
  feed.SetLost();
  EXPECT_TRUE(feed.is_lost());
  EXPECT_FALSE(feed.needs_request());
  feed.Restart();
  EXPECT_THAT(Request(feed), ElementsAre(7));
  EXPECT_THAT(feed.Select(StepOf({3}), 1 << 20).avatars,
              IsEmpty());  // the client discarded it because of the missing step
}

}  // namespace
}  // namespace stridewire::server
