// Walks to random places, on level and uneven ground. They must arrive on a short path or report a
// reason.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>

#include "captured_library.h"
#include "counted_memory.h"
#include "random.h"
#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
using Ground = std::shared_ptr<const Terrain>;
constexpr double kTickS = 1.0 / 30.0;
constexpr double kLongestS = 120.0;
constexpr double kDegree = M_PI / 180.0;

struct Walker {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
  double least_level;                 // Least fraction of walks that arrive on level ground.
  double least_rough;                 // Least fraction of walks that arrive on uneven ground.
};
void PrintTo(const Walker& walker, std::ostream* out) { *out << walker.name; }

// Hills with slopes below 20 degrees, and slabs to step onto.
Ground RoughGround(Random& random) {
  HeightField field{{-10.0, -10.0}, 0.5, 41, 41, {}};
  const double phase[3] = {random.Draw(0, 6), random.Draw(0, 6), random.Draw(0, 6)};
  for (int row = 0; row < field.rows; ++row) {
    for (int column = 0; column < field.columns; ++column) {
      const double x = -10.0 + 0.5 * column;
      const double z = -10.0 + 0.5 * row;
      field.heights_m.push_back(static_cast<float>(0.2 * std::sin(0.7 * x + phase[0]) +
                                                   0.2 * std::sin(0.6 * z + phase[1]) +
                                                   0.05 * std::sin(1.5 * (x + z) + phase[2])));
    }
  }
  TerrainData data{.height_field = std::move(field), .boxes = {}};
  const Ground hills = Terrain::Make(data).value();
  for (int i = 0; i < 25; ++i) {
    const GroundPoint min{random.Draw(-9.0, 8.0), random.Draw(-9.0, 8.0)};
    const GroundPoint max{min.x + random.Draw(0.8, 2.0), min.z + random.Draw(0.8, 2.0)};
    const double under = hills->HighestWithin(0.5 * (min.x + max.x), 0.5 * (min.z + max.z), 0.0);
    data.boxes.push_back({min, max, under + random.Draw(0.05, 0.2)});
  }
  return Terrain::Make(std::move(data)).value();
}

struct Walk {
  bool ended = false;
  bool arrived = false;
  std::string reason;
  int steps = 0;
  double away_m = 0.0;  // Distance of the base from the goal.
  double away_rad = 0.0;
  double root_m = 0.0;  // Distance of the displayed root from the goal, at rest.
  double path_m = 0.0;  // Length of the path of the base.
};

Walk GoTo(AvatarSimulation& avatar, const WalkRequest& goal) {
  Walk walk;
  EXPECT_TRUE(avatar.Enqueue({1, goal}).has_value());
  DVec3 at = avatar.base().position_m;
  for (double t = 0.0; t < kLongestS && !walk.ended; t += kTickS) {
    avatar.Advance(kTickS);
    for (const AvatarEvent& event : avatar.events()) {
      if (event.type == AvatarEventType::kRejected) {
        walk.ended = true;
        walk.reason = event.reason;
      } else if (event.type == AvatarEventType::kFinished && event.kind == MovementKind::kStand) {
        walk.ended = walk.arrived = true;
      } else if (event.type == AvatarEventType::kFinished) {
        ++walk.steps;
        walk.path_m += std::hypot(event.base.position_m.x - at.x, event.base.position_m.z - at.z);
        at = event.base.position_m;
      }
    }
  }
  const DVec3 away = avatar.base().position_m - goal.position_m;
  walk.away_m = std::hypot(away.x, away.z);
  walk.away_rad = std::fabs(WrapAngle(avatar.base().heading_rad - goal.heading_rad));
  // The body comes to rest while the avatar settles.
  for (double t = 0.0; t < 0.5; t += kTickS) avatar.Advance(kTickS);
  const ConstPoseSpan pose = avatar.pose();
  walk.root_m = std::hypot(pose.root_position_m.x - goal.position_m.x,
                           pose.root_position_m.z - goal.position_m.z);
  return walk;
}

// Walks to a thousand random goals. Returns the fraction that arrived.
double WalkAbout(const char* name, const Library& library, const Ground& ground, Random& random) {
  std::map<std::string, int> reasons;
  int arrived = 0;
  int steps = 0;
  int far_away = 0;
  int longer = 0;
  double worst_ratio = 0.0;
  double worst_m = 0.0;
  double worst_rad = 0.0;
#ifdef __SANITIZE_ADDRESS__
  constexpr int kWalks = 200;
#else
  constexpr int kWalks = 1000;
#endif
  for (int i = 0; i < kWalks; ++i) {
    const auto place = [&] { return DVec3(random.Draw(-6, 6), 0.0, random.Draw(-6, 6)); };
    BaseFrame start{place(), random.Draw(-M_PI, M_PI)};
    if (ground != nullptr) {
      start.position_m.y = ground->HeightAt(start.position_m.x, start.position_m.z);
    }
    WalkRequest goal;
    // Half of the goals are close, where there are many ways to get there.
    goal.position_m = i % 2 == 0 ? place() : start.position_m + 0.2 * place();
    goal.heading_rad = random.Draw(-M_PI, M_PI);
    AvatarSimulation avatar(library, start, {.terrain = ground});
    const Walk walk = GoTo(avatar, goal);
    EXPECT_TRUE(walk.ended) << i;
    steps += walk.steps;
    if (!walk.arrived) {
      EXPECT_FALSE(walk.reason.empty()) << i;
      ++reasons[walk.reason];
      continue;
    }
    ++arrived;
    worst_m = std::max({worst_m, walk.away_m, walk.root_m});
    worst_rad = std::max(worst_rad, walk.away_rad);
    const double straight_m =
        std::hypot(goal.position_m.x - start.position_m.x, goal.position_m.z - start.position_m.z);
    if (straight_m < 2.0) continue;
    ++far_away;
    longer += walk.path_m > 1.25 * straight_m;
    worst_ratio = std::max(worst_ratio, walk.path_m / straight_m);
  }
  // Walks around steep ground may be longer, but they are rare.
  EXPECT_LE(longer, far_away / 200);
  EXPECT_LE(worst_m, 0.01);
  EXPECT_LE(worst_rad, kDegree);
  std::printf(
      "%s: %d of %d arrive in %d steps, at worst %.2f mm and %.3f deg away, %d of %d ways longer "
      "than 1.25, up to %.3f\n",
      name, arrived, kWalks, steps, 1e3 * worst_m, worst_rad / kDegree, longer, far_away,
      worst_ratio);
  for (const auto& [reason, count] : reasons) std::printf("  %4d %s\n", count, reason.c_str());
  return static_cast<double>(arrived) / kWalks;
}

class WalkTo : public testing::TestWithParam<Walker> {};
INSTANTIATE_TEST_SUITE_P(Libraries, WalkTo,
                         testing::Values(Walker{"Builtin", {}, 1.0, 0.85},
                                         Walker{"Subject16", {"16"}, 1.0, 0.85}),
                         [](const auto& walker) { return walker.param.name; });

TEST_P(WalkTo, ReachesRandomGoalsOnLevelGround) {
  STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
  const Library library = LibraryOf(GetParam().subjects);
  const unsigned seed = 20261121;
  std::printf("seed %u\n", seed);
  Random random(seed);
  EXPECT_GE(WalkAbout(GetParam().name, library, nullptr, random), GetParam().least_level);
}

TEST_P(WalkTo, ReachesRandomGoalsOnRoughGround) {
  STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
  const Library library = LibraryOf(GetParam().subjects);
  const unsigned seed = 20261122;
  std::printf("seed %u\n", seed);
  Random random(seed);
  const Ground ground = RoughGround(random);
  EXPECT_GE(WalkAbout(GetParam().name, library, ground, random), GetParam().least_rough);
}

TEST(WalkTo, AppliesANewGoalFromTheNextStep) {
  AvatarSimulation avatar(OpenLibrary("builtin").value(), BaseFrame{});
  ASSERT_TRUE(avatar.Enqueue({1, WalkRequest{.position_m = {0.0, 0.0, 5.0}}}).has_value());
  for (int i = 0; i < 60; ++i) avatar.Advance(kTickS);
  EXPECT_EQ(avatar.CancelQueue(), 1);
  const double way_m = avatar.base().position_m.z;
  const Walk walk = GoTo(avatar, {.position_m = {2.0, 0.0, 1.0}, .heading_rad = 1.0});
  EXPECT_TRUE(walk.arrived);
  EXPECT_LT(way_m, 2.0);
  EXPECT_LT(walk.away_m, 0.01);
  EXPECT_LT(walk.path_m, 5.0);
}

TEST(WalkTo, DoesNotAllocate) {
  Random random(3);
  AvatarSimulation avatar(OpenLibrary("builtin").value(), BaseFrame{},
                          {.terrain = RoughGround(random)});
  WalkRequest goal{.position_m = {2.0, 0.0, 3.0}, .heading_rad = 2.0};
  goal.waypoints_m = {{0.0, 0.0, 2.0}};
  ASSERT_TRUE(avatar.Enqueue({1, goal}).has_value());
  avatar.Advance(kTickS);
  const std::size_t before = counted_memory::LiveBytes();
  counted_memory::ResetPeak();
  int ticks = 0;
  for (; !avatar.idle() && ticks < 3000; ++ticks) avatar.Advance(kTickS);
  EXPECT_GT(ticks, 60);
  EXPECT_LE(counted_memory::PeakBytes(), before);
}

TEST(WalkTo, PassesWaypoints) {
  AvatarSimulation avatar(OpenLibrary("builtin").value(), BaseFrame{});
  WalkRequest goal{.position_m = {4.0, 0.0, 0.0}, .heading_rad = 3.0};
  goal.waypoints_m = {{0.0, 0.0, 3.0}, {4.0, 0.0, 3.0}};
  ASSERT_TRUE(avatar.Enqueue({1, goal}).has_value());
  double nearest_m[2] = {9.0, 9.0};
  double longest_stop_s = 0.0;
  while (!avatar.idle()) {
    avatar.Advance(kTickS);
    for (int i = 0; i < 2; ++i) {
      const DVec3 away = avatar.base().position_m - goal.waypoints_m[static_cast<std::size_t>(i)];
      nearest_m[i] = std::min(nearest_m[i], std::hypot(away.x, away.z));
    }
    if (avatar.movement() == nullptr && !avatar.idle()) longest_stop_s += kTickS;
  }
  EXPECT_LT(nearest_m[0], 0.5);
  EXPECT_LT(nearest_m[1], 0.5);
  EXPECT_EQ(longest_stop_s, 0.0);
  EXPECT_LT(std::hypot(avatar.base().position_m.x - 4.0, avatar.base().position_m.z), 0.01);
}

TEST(WalkTo, KeepsTheRequestedSpeed) {
  const Library library = OpenLibrary("builtin").value();
  double seconds[2];
  const double speeds_m_s[2] = {0.5, 1.0};
  for (int i = 0; i < 2; ++i) {
    AvatarSimulation avatar(library, BaseFrame{});
    WalkRequest goal{.position_m = {0.0, 0.0, 10.0}};
    goal.speed_m_s = speeds_m_s[i];
    ASSERT_TRUE(avatar.Enqueue({1, goal}).has_value());
    seconds[i] = 0.0;
    for (; !avatar.idle(); seconds[i] += kTickS) avatar.Advance(kTickS);
    EXPECT_NEAR(10.0 / seconds[i], speeds_m_s[i], 0.2 * speeds_m_s[i]);
  }
  EXPECT_LT(seconds[1], 0.7 * seconds[0]);
}

TEST(WalkTo, ReportsWhyItFails) {
  const Library library = OpenLibrary("builtin").value();
  const Ground wall =
      Terrain::Make({.height_field = {}, .boxes = {{{-20.0, 2.0}, {20.0, 2.5}, 1.5}}}).value();
  AvatarSimulation avatar(library, BaseFrame{}, {.terrain = wall});
  const Walk behind = GoTo(avatar, {.position_m = {0.0, 0.0, 5.0}});
  EXPECT_FALSE(behind.arrived);
  EXPECT_FALSE(behind.reason.empty());
  EXPECT_LT(behind.steps, 60);
  const Walk edge = GoTo(avatar, {.position_m = {0.0, 0.0, 2.4}});
  EXPECT_EQ(edge.reason, "the ground at the goal is too steep or too uneven to stand on");
  // The avatar accepts the next walk.
  EXPECT_TRUE(GoTo(avatar, {.position_m = {0.5, 0.0, -1.0}, .heading_rad = 3.0}).arrived);
}

}  // namespace
}  // namespace stridewire
