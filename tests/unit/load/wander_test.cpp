#include "wander.h"

#include <gtest/gtest.h>

#include <set>

#include "run_state.h"

namespace stridewire::load {
namespace {

TEST(Wanderer, IsTheSameForTheSameSeedAndAvatar) {
  Wanderer one(5, 3);
  Wanderer same(5, 3);
  Wanderer other(5, 4);
  bool differs = false;
  for (int i = 0; i < 20; ++i) {
    const WanderPlan plan = one.Next(true);
    const WanderPlan again = same.Next(true);
    EXPECT_EQ(plan.movements, again.movements);
    EXPECT_EQ(plan.period_s, again.period_s);
    differs = differs || plan.movements != other.Next(true).movements;
  }
  EXPECT_TRUE(differs);
}

TEST(Wanderer, StartsEveryPlanWithAMovementAndUsesAllKinds) {
  std::set<std::size_t> kinds;
  for (std::uint32_t avatar = 1; avatar <= 100; ++avatar) {
    Wanderer wanderer(1, avatar);
    for (int i = 0; i < 10; ++i) {
      const WanderPlan plan = wanderer.Next(true);
      ASSERT_FALSE(plan.movements.empty());
      EXPECT_LE(plan.movements.size(), 17u);
      EXPECT_FALSE(std::holds_alternative<protocol::StandMovement>(plan.movements.front()));
      EXPECT_GT(plan.period_s, 0.6 * static_cast<double>(plan.movements.size()));
      for (const Movement& movement : plan.movements) {
        kinds.insert(movement.index());
        if (const auto* step = std::get_if<protocol::StepMovement>(&movement)) {
          EXPECT_GE(step->length_m, 0.4);
          EXPECT_LE(step->length_m, 0.7);
          EXPECT_LE(std::abs(step->turn_rad), 0.3);
        }
      }
    }
  }
  EXPECT_EQ(kinds.size(), 3u);
}

TEST(Wanderer, DoesNotJumpIfDisabled) {
  for (std::uint32_t avatar = 1; avatar <= 100; ++avatar) {
    Wanderer wanderer(1, avatar);
    for (const Movement& movement : wanderer.Next(false).movements) {
      EXPECT_FALSE(std::holds_alternative<protocol::JumpMovement>(movement));
    }
  }
}

TEST(SmallRandom, StaysInItsRange) {
  SmallRandom random(9);
  std::set<int> seen;
  for (int i = 0; i < 10'000; ++i) {
    const double x = random.Uniform(-2.0, 3.0);
    EXPECT_GE(x, -2.0);
    EXPECT_LT(x, 3.0);
    seen.insert(random.Integer(2, 5));
  }
  EXPECT_EQ(seen, (std::set<int>{2, 3, 4, 5}));
}

TEST(Layout, AssignsEachAvatarToOneWorld) {
  for (const int worlds : {1, 2, 3, 7}) {
    for (const int avatars : {7, 8, 20, 21}) {
      const Layout layout{avatars, worlds};
      std::set<std::uint32_t> numbers;
      for (int world = 0; world < worlds; ++world) {
        for (std::size_t i = 0; i < layout.CountIn(world); ++i) {
          const std::uint32_t number = layout.Number(world, i);
          EXPECT_TRUE(layout.IsOurs(world, number));
          EXPECT_EQ(layout.IndexIn(number), i);
          EXPECT_EQ(layout.IsOurs((world + 1) % worlds, number), worlds == 1);
          numbers.insert(number);
        }
      }
      EXPECT_EQ(numbers.size(), static_cast<std::size_t>(avatars));
      EXPECT_EQ(*numbers.begin(), 1u);
      EXPECT_EQ(*numbers.rbegin(), static_cast<std::uint32_t>(avatars));
      EXPECT_FALSE(layout.IsOurs(0, 0));
      EXPECT_FALSE(layout.IsOurs(avatars % worlds, static_cast<std::uint32_t>(avatars) + 1));
    }
  }
}

TEST(TickWindow, CountsOnlyItsTicks) {
  TickWindow window;
  EXPECT_FALSE(window.Contains(0));
  EXPECT_EQ(window.CountBetween(0, 100), 0u);
  window.Set(10, 19);
  EXPECT_FALSE(window.Contains(9));
  EXPECT_TRUE(window.Contains(10));
  EXPECT_TRUE(window.Contains(19));
  EXPECT_FALSE(window.Contains(20));
  EXPECT_EQ(window.CountBetween(0, 100), 10u);
  EXPECT_EQ(window.CountBetween(15, 16), 2u);
  EXPECT_EQ(window.CountBetween(18, 30), 2u);
  EXPECT_EQ(window.CountBetween(16, 15), 0u);
  EXPECT_EQ(window.CountBetween(20, 30), 0u);
}

}  // namespace
}  // namespace stridewire::load
