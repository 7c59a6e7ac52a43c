// Walks and stops with libraries that lack starts, stops or turns.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "captured_library.h"
#include "offline/builtin/builtin_library.h"
#include "random.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/plan/walk_planner.h"
#include "runtime/skeleton/foot_vector.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
constexpr double kTickS = 1.0 / 60.0;

// The generated library with only those straight steps that begin and end in a stride of at least
// `shortest_m`. If `stands_in_stride`, its stand pose is the first pose of a step, as in captures
// without a stand.
Library StridesOf(double shortest_m, bool stands_in_stride) {
  RawLibrary raw = GenerateBuiltinLibrary();
  std::erase_if(raw.groups, [](const RawGroup& group) {
    return !IsStep(group.kind) ||
           group.parameters != std::vector{ParameterName::kStartZ, ParameterName::kEndZ};
  });
  raw.groups.resize(2);  // The first two groups walk forward.
  for (RawGroup& group : raw.groups) {
    std::erase_if(group.examples, [&](const RawExample& step) {
      return -step.parameters[0] < shortest_m || step.parameters[1] < shortest_m;
    });
  }
  if (stands_in_stride) {
    const ConstPoseSpan first = raw.groups[0].examples[0].clip.frame(0);
    raw.stand_pose.root_position_m = first.root_position_m;
    raw.stand_pose.rotations.assign(first.rotations.begin(), first.rotations.end());
  }
  return LibraryBuilder().Build(raw).value();
}

double FeetApartFromStandM(const AvatarSimulation& avatar) {
  const MotionLibrary& library = avatar.library();
  const DVec3 stand = FootVector(library.skeleton(), library.stand_pose(), Foot::kLeft, 0.0);
  const DVec3 now =
      FootVector(library.skeleton(), avatar.pose(), Foot::kLeft, avatar.base().heading_rad);
  return std::hypot(now.x - stand.x, now.z - stand.z);
}

struct Played {
  std::vector<Foot> feet;      // Moving feet of the steps, in order.
  std::vector<DVec3> strikes;  // Where they landed.
  bool arrived = false;
  std::string reason;       // Of the rejection.
  std::string idle_reason;  // Of the kIdle event.
};

Played Play(AvatarSimulation& avatar) {
  Played played;
  for (int tick = 0; tick < 7200 && !(tick > 0 && avatar.idle()); ++tick) {
    avatar.Advance(kTickS);
    for (const AvatarEvent& event : avatar.events()) {
      if (event.type == AvatarEventType::kStarted && IsStep(event.kind)) {
        played.feet.push_back(MovingFoot(event.kind));
      }
      if (event.type == AvatarEventType::kFootStrike) {
        played.strikes.push_back(DVec3(event.position_m));
      }
      if (event.type == AvatarEventType::kRejected) played.reason = event.reason;
      if (event.type == AvatarEventType::kIdle) played.idle_reason = event.reason;
      played.arrived |=
          event.type == AvatarEventType::kFinished && event.kind == MovementKind::kStand;
    }
  }
  EXPECT_TRUE(avatar.idle());
  return played;
}

Played WalkTo(AvatarSimulation& avatar, const WalkRequest& goal) {
  EXPECT_TRUE(avatar.Enqueue({1, goal}).has_value());
  return Play(avatar);
}

// Expects a walk of 3 m that begins with the foot behind and alternates in equal steps.
void ExpectAnEvenWalk(const Library& library) {
  const double left_ahead_m =
      FootVector(library->skeleton(), library->stand_pose(), Foot::kLeft, 0.0).z;
  ASSERT_GT(std::fabs(left_ahead_m), 0.3);
  AvatarSimulation avatar(library, BaseFrame{});
  const Played walk = WalkTo(avatar, {.position_m = {0.0, 0.0, 3.0}});
  EXPECT_TRUE(walk.arrived) << walk.reason;
  EXPECT_NEAR(avatar.base().position_m.z, 3.0, 0.03);
  ASSERT_GE(walk.feet.size(), 4u);
  EXPECT_EQ(walk.feet.front(), left_ahead_m > 0.0 ? Foot::kRight : Foot::kLeft);
  double shortest_m = HUGE_VAL;
  double longest_m = 0.0;
  for (std::size_t i = 1; i < walk.feet.size(); ++i) {
    EXPECT_NE(walk.feet[i], walk.feet[i - 1]) << i;
    const double length_m = walk.strikes[i].z - walk.strikes[i - 1].z;
    shortest_m = std::min(shortest_m, length_m);
    longest_m = std::max(longest_m, length_m);
  }
  // The last step ends in the stride of the stand pose.
  EXPECT_LE(longest_m - shortest_m, 0.2);
  EXPECT_LE(FeetApartFromStandM(avatar), 0.03);
}

// Returns the mean time of the steps of a walk of 8 m, without the first two and the last two.
double MeanStepS(const Library& library, std::optional<double> speed_m_s) {
  AvatarSimulation avatar(library, BaseFrame{});
  WalkRequest goal{.position_m = {0.0, 0.0, 8.0}};
  goal.speed_m_s = speed_m_s;
  EXPECT_TRUE(avatar.Enqueue({1, goal}).has_value());
  std::vector<double> started_s;
  for (double time_s = 0.0; time_s < 60.0 && !(time_s > 0.0 && avatar.idle()); time_s += kTickS) {
    avatar.Advance(kTickS);
    for (const AvatarEvent& event : avatar.events()) {
      if (event.type == AvatarEventType::kStarted && IsStep(event.kind))
        started_s.push_back(time_s);
    }
  }
  EXPECT_GT(started_s.size(), 8u);
  return (started_s[started_s.size() - 3] - started_s[2]) /
         static_cast<double>(started_s.size() - 5);
}

// Steps of `builtin` take 0.55 to 0.6 s. If captured steps take longer, they are played faster,
// unless the caller asks for a speed.
TEST(WalkFit, SlowStepsArePlayedFasterWithoutARequestedSpeed) {
  RawLibrary raw = GenerateBuiltinLibrary();
  for (RawGroup& group : raw.groups) {
    for (RawExample& example : group.examples) {
      example.clip.fps /= 1.4;
      for (double& keytime_s : example.keytimes_s) keytime_s *= 1.4;
    }
  }
  const Library slow = LibraryBuilder().Build(raw).value();
  EXPECT_LT(MeanStepS(slow, std::nullopt), 0.65);
  EXPECT_GT(MeanStepS(slow, 0.6), 0.72);
}

TEST(WalkFit, LibraryWithoutStartAndStopWalksEvenly) { ExpectAnEvenWalk(StridesOf(0.35, true)); }

TEST(WalkFit, CaptureWithoutStartAndStopWalksEvenly) {
  const std::filesystem::path file =
      MocapDir().parent_path() / "cases" / "m24_walk_without_stand.bvh";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "there is no " << file.string();
  for (const bool mirror : {false, true}) {
    const RawLibrary raw = AssembleTakes({file}, {.mirror = mirror});
    ExpectAnEvenWalk(LibraryBuilder::Selecting().Build(raw).value());
  }
}

TEST(WalkFit, LibraryWithoutStopClosesItsFeetAtTheGoal) {
  AvatarSimulation avatar(StridesOf(0.35, false), BaseFrame{});
  const Played walk = WalkTo(avatar, {.position_m = {0.0, 0.0, 3.0}});
  EXPECT_TRUE(walk.arrived) << walk.reason;
  EXPECT_LE(FeetApartFromStandM(avatar), 0.01);
  EXPECT_EQ(walk.idle_reason, "");
}

TEST(WalkFit, WalksEndSoonWhetherTheyArriveOrNot) {
  Random random(20);
  int arrived = 0;
  for (const bool stands_in_stride : {false, true}) {
    const Library library = StridesOf(0.5, stands_in_stride);
    for (int i = 0; i < 40; ++i) {
      AvatarSimulation avatar(library, BaseFrame{});
      const WalkRequest goal{.position_m = {random.Draw(-3, 3), 0.0, random.Draw(-3, 3)},
                             .heading_rad = random.Draw(-M_PI, M_PI)};
      const Played walk = WalkTo(avatar, goal);
      EXPECT_NE(walk.arrived, !walk.reason.empty());
      EXPECT_LE(walk.feet.size(), 40u);
      arrived += walk.arrived;
    }
  }
  std::printf("%d of 80 walks arrive\n", arrived);
  EXPECT_GE(arrived, 20);
}

TEST(WalkFit, EndsAfterTwoStepsWithoutProgress) {
  const Library library = OpenLibrary("builtin").value();
  const LocomotionProfile& profile = library->locomotion_profile();
  WalkStance stance;
  for (std::size_t f = 0; f < 2; ++f) stance.feet[f].position_m = profile.stand_feet_m[f];
  stance.vector.left_from_right_m = profile.stand_feet_m[0] - profile.stand_feet_m[1];
  const WalkRequest walk{.position_m = {0.0, 0.0, 3.0}};
  // The walk has been at the goal before, so standing here is no progress.
  WalkProgress progress{.least_effort_m = 0.0};
  EXPECT_EQ(PlanWalkStep(*library, nullptr, walk, stance, progress).outcome, WalkOutcome::kStep);
  const WalkDecision second = PlanWalkStep(*library, nullptr, walk, stance, progress);
  EXPECT_EQ(second.outcome, WalkOutcome::kRefused);
  EXPECT_STREQ(second.reason, "the library has no step that leads closer to the goal");
}

TEST(Stop, PlantingClosesTheFeet) {
  AvatarSimulation avatar(StridesOf(0.35, false), BaseFrame{});
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.5}}).has_value());
  }
  const Played steps = Play(avatar);
  EXPECT_EQ(steps.feet.size(), 4u);  // The last one is the closing step.
  EXPECT_LE(FeetApartFromStandM(avatar), 0.01);
  EXPECT_EQ(steps.idle_reason, "");
}

TEST(Stop, StepsThatCannotCloseAreNotTaken) {
  AvatarSimulation avatar(StridesOf(0.7, false), BaseFrame{});
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.75}}).has_value());
  }
  const Played steps = Play(avatar);
  EXPECT_EQ(steps.feet.size(), 3u);
  EXPECT_GT(FeetApartFromStandM(avatar), 0.5);
  EXPECT_EQ(steps.idle_reason, "the library has no step that brings the feet together from here");
}

// The last two stones are 0.2 m and 0.4 m high and leave room for one foot each.
TEST(Stop, FeetStayApartIfThereIsNoGroundBesideThem) {
  for (const bool has_room : {false, true}) {
    const double left_m = has_room ? 0.2 : 0.0;
    TerrainData data;
    data.boxes.push_back({{0.0, 0.3}, {0.2, 0.7}, 0.2});
    data.boxes.push_back({{-0.2, 0.8}, {left_m, 1.2}, 0.4});
    AvatarSimulation avatar(LibraryOf({}), BaseFrame{},
                            {.terrain = Terrain::Make(std::move(data)).value()});
    for (const auto& [foot, at] : {std::pair{Foot::kLeft, DVec3(0.08, 0.2, 0.55)},
                                   std::pair{Foot::kRight, DVec3(-0.08, 0.4, 1.05)}}) {
      ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.foot = foot, .at = {{at, 0.0}}}}).has_value());
    }
    const Played steps = Play(avatar);
    EXPECT_EQ(steps.feet.size(), has_room ? 3u : 2u);
    EXPECT_EQ(
        steps.idle_reason,
        has_room ? "" : "the ground beside the foot is too high or too low for the other foot");
  }
}

TEST(Stop, LibraryThatStandsInAStrideStopsInThatStride) {
  AvatarSimulation avatar(StridesOf(0.35, true), BaseFrame{});
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.5}}).has_value());
  }
  const Played steps = Play(avatar);
  EXPECT_LE(steps.feet.size(), 4u);
  EXPECT_LE(FeetApartFromStandM(avatar), 0.13);
  EXPECT_EQ(steps.idle_reason, "");
}

}  // namespace
}  // namespace stridewire
