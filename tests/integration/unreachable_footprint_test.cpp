// Steps with exact placement: those out of reach are rejected, all others land on their footprint.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "captured_library.h"
#include "counted_memory.h"
#include "random.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/foot_vector.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/synthesis.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
using Type = AvatarEventType;
constexpr double kTickS = 1.0 / 60.0;
constexpr double kDegrees = 180.0 / M_PI;

MovementRequest StepOnto(std::uint64_t id, Foot foot, const DVec3& place_m, double heading_rad,
                         bool exact_only = true) {
  return {id, StepRequest{.foot = foot,
                          .at = {{place_m, heading_rad}},
                          .exact_only = exact_only,
                          .allow_nearest = !exact_only}};
}

BlendedFoot SeenFoot(const AvatarSimulation& avatar, Foot foot) {
  const MotionLibrary& library = avatar.library();
  LegPose leg;
  EvaluateLeg(library.skeleton(), library.leg_rig(), avatar.pose(), foot, leg);
  return FootOf(library.leg_rig(), foot, DVec3(avatar.pose().root_position_m), leg);
}

struct Walker {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
};
void PrintTo(const Walker& walker, std::ostream* out) { *out << walker.name; }

class ExactPlacementLibraries : public testing::TestWithParam<Walker> {};
INSTANTIATE_TEST_SUITE_P(Libraries, ExactPlacementLibraries,
                         testing::Values(Walker{"Builtin", {}}, Walker{"Subject16", {"16"}},
                                         Walker{"Debian", {kDebianTakes}}),
                         [](const auto& walker) { return walker.param.name; });

// The error of both feet from landing to the end of a step.
struct Seen {
  bool is_rejected = false;
  double off_m = 0.0;  // Distance of either foot from its target.
  double off_rad = 0.0;
};

// Advances until the request has ended and measures the feet from the displayed pose only.
Seen Watch(AvatarSimulation& avatar, std::uint64_t id, Foot foot, const Footprint& asked,
           const DVec3& stays_m) {
  const double ball_m = avatar.library().leg_rig().side(foot).ball_height_m;
  Seen seen;
  // Stop just before the end, so that the next movement has no effect.
  constexpr double kJustBeforeS = 1e-4;
  bool has_finished = false;
  int looks = 0;
  for (int tick = 0; tick < 1200 && !has_finished; ++tick) {
    const auto is_under_way = [&] {
      return avatar.movement() != nullptr && avatar.started()->request_id == id;
    };
    const double left_s =
        is_under_way() ? avatar.movement()->duration_s() - avatar.movement_time_s() : 0.0;
    avatar.Advance(left_s > 2.0 * kJustBeforeS ? std::min(kTickS, left_s - kJustBeforeS) : kTickS);
    for (const AvatarEvent& event : avatar.events()) {
      if (event.request_id != id) continue;
      seen.is_rejected |= event.type == Type::kRejected;
      has_finished |= event.type == Type::kFinished;
    }
    if (seen.is_rejected) return seen;
    if (!is_under_way() ||
        avatar.movement_time_s() + 2.0 * kJustBeforeS < avatar.movement()->feet.foot(foot).land_s) {
      continue;
    }
    ++looks;
    const BlendedFoot lands = SeenFoot(avatar, foot);
    const BlendedFoot stays = SeenFoot(avatar, OtherFoot(foot));
    const DVec3 away = lands.ball_m - asked.position_m;
    const DVec3 drawn = stays.ball_m - stays_m;
    seen.off_m = std::max({seen.off_m, std::hypot(away.x, away.z), std::hypot(drawn.x, drawn.z)});
    // If the heel rises, the ball rises with it.
    for (const double up_m : {away.y - ball_m, drawn.y - ball_m}) {
      if (std::fabs(up_m) > 0.1) seen.off_m = std::max(seen.off_m, std::fabs(up_m));
    }
    seen.off_rad =
        std::max(seen.off_rad, std::fabs(WrapAngle(lands.heading_rad - asked.heading_rad)));
  }
  EXPECT_TRUE(has_finished);
  EXPECT_GT(looks, 0);
  return seen;
}

// From a stand or during a walk. Half of the footprints are at probable ends of a step, the others
// anywhere around. Whether a footprint is in reach is determined with a copy of the avatar that
// does not require exact placement.
TEST_P(ExactPlacementLibraries, ReachesFootprintsInReachAndRejectsOthers) {
  STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
  const Library library = LibraryOf(GetParam().subjects);
  const unsigned seed = 20261122;
  Random random(seed);
  AvatarSimulation avatar(library, BaseFrame{});
  int inside = 0, refused_inside = 0, outside = 0, played_outside = 0, refused = 0, nearest_met = 0;
  double worst_m = 0.0;
  double worst_rad = 0.0;
#ifdef __SANITIZE_ADDRESS__
  constexpr int kFootprints = 200;
#else
  constexpr int kFootprints = 1000;
#endif
  const char* asked = std::getenv("STRIDEWIRE_FOOTPRINTS");
  const int footprints = asked == nullptr ? kFootprints : std::atoi(asked);
  for (std::uint64_t id = 1; id <= static_cast<std::uint64_t>(footprints); ++id) {
    // Stay near the origin, where floats are precise.
    if (glm::length(avatar.base().position_m) > 30.0) avatar.Teleport(BaseFrame{});
    if (random.Draw(0, 1) < 0.3) {
      while (!avatar.idle()) avatar.Advance(kTickS);
    }
    Foot foot = random.Draw(0, 1) < 0.5 ? Foot::kLeft : Foot::kRight;
    const Movement* before = avatar.movement();
    double heading_rad = avatar.base().heading_rad;
    if (before != nullptr) {
      foot = OtherFoot(MovingFoot(library->group(before->group).kind));
      heading_rad = before->base.heading_rad + before->heading_change_rad + before->extra_turn_rad;
    }
    DVec3 stays_m = SeenFoot(avatar, OtherFoot(foot)).ball_m;
    stays_m.y -= library->leg_rig().side(OtherFoot(foot)).ball_height_m;
    if (before != nullptr) stays_m = before->feet.foot(OtherFoot(foot)).to.position_m;
    const double sign = foot == Foot::kLeft ? 1.0 : -1.0;
    const bool is_near = random.Draw(0, 1) < 0.5;
    const double far_m = random.Draw(0, 1) < 0.5 ? 0.0 : 2.5;  // Sometimes far up or down.
    heading_rad += is_near ? random.Draw(-0.3, 0.3) : random.Draw(-1.2, 1.2);
    const DVec3 vector = is_near ? DVec3(sign * random.Draw(0.1, 0.3), 0.0, random.Draw(0.1, 0.7))
                                 : DVec3(sign * random.Draw(-0.4, 1.0), random.Draw(-far_m, far_m),
                                         random.Draw(-1.0, 1.8));
    const Footprint print{stays_m + RotateYaw(heading_rad, vector), heading_rad};

    AvatarSimulation other = avatar;
    ASSERT_TRUE(
        other.Enqueue(StepOnto(id, foot, print.position_m, heading_rad, false)).has_value());
    const Seen near = Watch(other, id, foot, print, stays_m);
    const bool is_outside = near.off_m > 1e-3 || near.off_rad * kDegrees > 0.1;
    // Within half a metre up or down no leg is too short. Further away, the pose does not show
    // whether a foot is slightly too high.
    const bool is_inside =
        near.off_m <= 0.8e-3 && near.off_rad * kDegrees <= 0.05 && std::fabs(vector.y) < 0.5;
    outside += is_outside;
    inside += is_inside;

    other = avatar;
    ASSERT_TRUE(other.Enqueue(StepOnto(id, foot, print.position_m, heading_rad)).has_value());
    const Seen seen = Watch(other, id, foot, print, stays_m);
    if (seen.is_rejected) {
      refused_inside += is_inside;
      ++refused;
      const auto told = std::ranges::find(other.events(), Type::kRejected, &AvatarEvent::type);
      const Footprint nearest = told->missed->nearest;
      AvatarSimulation again = avatar;
      ASSERT_TRUE(
          again.Enqueue(StepOnto(id, foot, nearest.position_m, nearest.heading_rad)).has_value());
      nearest_met += !Watch(again, id, foot, nearest, stays_m).is_rejected;
    } else {
      played_outside += is_outside;
      worst_m = std::max(worst_m, seen.off_m);
      worst_rad = std::max(worst_rad, seen.off_rad);
    }
    // Continue from there, during the walk.
    if (!seen.is_rejected) {
      ASSERT_TRUE(avatar.Enqueue(StepOnto(id, foot, print.position_m, heading_rad)).has_value());
    } else {
      const StepRequest step{.foot = foot, .length_m = 0.4, .allow_nearest = true};
      ASSERT_TRUE(avatar.Enqueue({id, step}).has_value());
    }
    int ticks = 0;
    while (avatar.started() == nullptr || avatar.started()->request_id != id) {
      avatar.Advance(kTickS);
      ASSERT_LT(++ticks, 600);
    }
  }
  std::printf(
      "%s: seed %u, %d footprints out of reach, %d of them played; %d in reach, %d of them "
      "refused; "
      "those played are met within %.4f mm and %.4f degrees; %d of the %d nearest are met when "
      "asked for\n",
      GetParam().name, seed, outside, played_outside, inside, refused_inside, 1e3 * worst_m,
      worst_rad * kDegrees, nearest_met, refused);
  EXPECT_EQ(played_outside, 0);
  EXPECT_EQ(refused_inside, 0);
  EXPECT_LE(worst_m, 1e-3);
  EXPECT_GE(nearest_met, refused * 9 / 10);
  EXPECT_GT(inside, footprints / 5);
  EXPECT_GT(outside, footprints / 5);
}

class ExactPlacement : public testing::Test {
 protected:
  // Queues steps. Those with an odd id require exact placement and are far out of reach.
  static void Queue(AvatarSimulation& avatar, std::initializer_list<std::uint64_t> ids) {
    for (const std::uint64_t id : ids) {
      MovementRequest request{id, StepRequest{.length_m = 0.5}};
      if (id % 2 == 1) request = StepOnto(id, Foot::kLeft, {0.0, 0.0, -9.0}, 0.0);
      ASSERT_TRUE(avatar.Enqueue(request).has_value());
    }
  }
  // Advances both avatars until they stand. They must display the same bits and have the same
  // events, except for rejections.
  static int AdvanceAlike(AvatarSimulation& refusing, AvatarSimulation& other) {
    int refused = 0;
    for (int tick = 0; tick < 1200 && !(other.idle() && refusing.idle()); ++tick) {
      refusing.Advance(kTickS);
      other.Advance(kTickS);
      std::vector<Type> seen;
      std::vector<Type> expected;
      for (const AvatarEvent& event : refusing.events()) {
        if (event.type == Type::kRejected) {
          ++refused;
        } else {
          seen.push_back(event.type);
        }
      }
      for (const AvatarEvent& event : other.events()) expected.push_back(event.type);
      EXPECT_EQ(seen, expected) << tick;
      EXPECT_EQ(refusing.pose().root_position_m, other.pose().root_position_m) << tick;
      EXPECT_TRUE(std::ranges::equal(refusing.pose().rotations, other.pose().rotations)) << tick;
    }
    EXPECT_TRUE(refusing.idle());
    return refused;
  }

  Library library_ = OpenLibrary("builtin").value();
  AvatarSimulation avatar_{library_, BaseFrame{}};
  AvatarSimulation other_{library_, BaseFrame{}};
};

TEST_F(ExactPlacement, RejectionDoesNotAffectOtherRequests) {
  Queue(avatar_, {1, 2, 4, 5, 7, 6, 9});
  Queue(other_, {2, 4, 6});
  EXPECT_EQ(AdvanceAlike(avatar_, other_), 4);
  const DVec3 apart = FootVector(library_->skeleton(), avatar_.pose(), Foot::kLeft, 0.0);
  EXPECT_LT(std::fabs(apart.z), 0.12);  // The feet are together.
}

TEST_F(ExactPlacement, ReportsTheNearestFootprintInReach) {
  Queue(avatar_, {1});
  avatar_.Advance(kTickS);
  ASSERT_EQ(avatar_.events().size(), 2u);
  const AvatarEvent event = avatar_.events()[0];
  EXPECT_EQ(event.type, Type::kRejected);
  EXPECT_EQ(event.request_id, 1u);
  EXPECT_EQ(event.code, ErrorCode::kOutOfRange);
  EXPECT_EQ(event.foot, Foot::kLeft);
  ASSERT_TRUE(event.missed.has_value());
  const DVec3 nearest = event.missed->nearest.position_m;
  EXPECT_NEAR(event.missed->distance_m, glm::length(nearest - DVec3(0.0, 0.0, -9.0)), 1e-9);
  EXPECT_GT(nearest.z, -2.0);
  EXPECT_LT(nearest.z, 0.0);
  EXPECT_EQ(avatar_.events()[1].type, Type::kIdle);
  const std::string text = DescribeRejection(event);
  EXPECT_TRUE(text.starts_with("the footprint is out of reach: the left foot reaches (")) << text;
  EXPECT_TRUE(text.ends_with(" degrees off")) << text;
  EXPECT_LE(text.size(), 200u);

  EXPECT_EQ(DescribeRejection({.type = Type::kRejected, .reason = "the goal is a hole"}),
            "the goal is a hole");
}

TEST_F(ExactPlacement, KeepsTheSwingIfARedirectionIsRejected) {
  for (AvatarSimulation* avatar : {&avatar_, &other_}) {
    Queue(*avatar, {2, 4});
    while (avatar->movement() == nullptr ||
           avatar->movement()->feet.foot(Foot::kRight).IsPlanted(avatar->movement_time_s()) ==
               avatar->movement()->feet.foot(Foot::kLeft).IsPlanted(avatar->movement_time_s())) {
      avatar->Advance(kTickS);
    }
    for (int i = 0; i < 4; ++i) avatar->Advance(kTickS);
  }
  const Foot moving = MovingFoot(avatar_.started()->kind);
  MovementRequest request = StepOnto(5, moving, {0.0, 0.0, 9.0}, 0.0);
  request.interrupt = Interrupt::kNow;
  ASSERT_TRUE(avatar_.Enqueue(request).has_value());
  other_.CancelQueue();
  EXPECT_EQ(AdvanceAlike(avatar_, other_), 1);
}

TEST_F(ExactPlacement, RedirectsASwingToAFootprintInReach) {
  ASSERT_TRUE(avatar_.Enqueue(StepOnto(2, Foot::kLeft, {0.1, 0.0, 0.5}, 0.0)).has_value());
  avatar_.Advance(kTickS);
  while (avatar_.movement()->feet.foot(Foot::kLeft).IsPlanted(avatar_.movement_time_s())) {
    avatar_.Advance(kTickS);
  }
  for (int i = 0; i < 4; ++i) avatar_.Advance(kTickS);
  MovementRequest request = StepOnto(4, Foot::kLeft, {0.2, 0.0, 0.4}, 0.1);
  request.interrupt = Interrupt::kNow;
  ASSERT_TRUE(avatar_.Enqueue(request).has_value());
  avatar_.Advance(kTickS);
  ASSERT_EQ(avatar_.events().size(), 2u);
  EXPECT_TRUE(avatar_.events()[0].is_cut_short);
  EXPECT_EQ(avatar_.events()[0].request_id, 2u);
  EXPECT_EQ(avatar_.events()[1].type, Type::kStarted);
  // The foot may rest less than a tick before the end of the movement.
  while (avatar_.movement() != nullptr &&
         avatar_.movement_time_s() < avatar_.movement()->feet.foot(Foot::kLeft).land_s) {
    avatar_.Advance(kTickS);
  }
  EXPECT_NEAR(SeenFoot(avatar_, Foot::kLeft).ball_m.x, 0.2, 1e-3);
  EXPECT_NEAR(SeenFoot(avatar_, Foot::kLeft).ball_m.z, 0.4, 1e-3);
}

TEST_F(ExactPlacement, TakesTheHeightFromTheGround) {
  TerrainData data;
  data.boxes.push_back({{-5.0, 0.2}, {5.0, 5.0}, 0.2});
  data.boxes.push_back({{-5.0, -5.0}, {5.0, -0.2}, 4.0});
  AvatarSimulation avatar(library_, BaseFrame{},
                          {.terrain = Terrain::Make(std::move(data)).value()});
  ASSERT_TRUE(avatar.Enqueue(StepOnto(1, Foot::kLeft, {0.1, 0.0, -0.4}, 0.0)).has_value());
  ASSERT_TRUE(avatar.Enqueue(StepOnto(2, Foot::kLeft, {0.1, 9.0, 0.45}, 0.0)).has_value());
  avatar.Advance(kTickS);
  ASSERT_EQ(avatar.events().size(), 2u);
  EXPECT_EQ(avatar.events()[0].type, Type::kRejected);
  EXPECT_EQ(avatar.events()[1].type, Type::kStarted);
  while (!avatar.idle()) avatar.Advance(kTickS);
  EXPECT_NEAR(avatar.base().position_m.y, 0.2, 0.01);
}

TEST_F(ExactPlacement, DoesNotAllocateAndLimitsRejectionsPerTick) {
  avatar_.Advance(kTickS);  // The first call allocates scratch memory.
  for (int i = 0; i < AvatarSimulation::kMaxQueue; ++i) Queue(avatar_, {2ull * i + 1});
  const std::size_t before = counted_memory::LiveBytes();
  counted_memory::ResetPeak();
  int refused = 0;
  int ticks = 0;
  const auto begin = std::chrono::steady_clock::now();
  while (!avatar_.idle() && ++ticks < 1000) {
    avatar_.Advance(kTickS);
    for (const AvatarEvent& event : avatar_.events()) refused += event.type == Type::kRejected;
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  EXPECT_LE(counted_memory::PeakBytes(), before);
  std::printf("%d refusals in %d ticks, %.1f us each\n", refused, ticks,
              1e6 * took.count() / refused);
  EXPECT_EQ(refused, AvatarSimulation::kMaxQueue);
  EXPECT_GE(ticks, AvatarSimulation::kMaxQueue / AvatarSimulation::kMaxEventsPerAdvance);
}

// Steps by length land exactly where they should, or are rejected.
TEST_F(ExactPlacement, PlacesStepsByLength) {
  const std::vector<StepRequest> steps = {
      {.length_m = 0.5, .exact_only = true},
      {.length_m = 0.6, .turn_rad = 0.3, .exact_only = true},
      {.length_m = 0.0, .side_m = 0.3, .exact_only = true},
      {.length_m = 1.3, .exact_only = true},
      {.foot = Foot::kLeft, .length_m = 0.4, .side_m = 0.15, .height_m = 0.1, .exact_only = true}};
  std::vector<MovementRequest> requests;
  for (const StepRequest& step : steps) requests.push_back({requests.size() + 1, step});
  const auto played = Synthesize({.library = library_, .requests = requests});
  ASSERT_TRUE(played.has_value());
  ASSERT_EQ(played->skipped.size(), 1u);
  const FootprintError& missed = played->skipped[0].missed;
  EXPECT_EQ(played->skipped[0].request_id, 4u);
  EXPECT_DOUBLE_EQ(missed.requested.length_m, 1.3);
  EXPECT_NEAR(missed.reached.length_m, 1.3 - missed.distance_m, 0.05);
  EXPECT_THAT(played->skipped[0].reason,
              testing::StartsWith("the step is out of reach: requested length 1.3 m"));
  int met = 0;
  for (const MovementRecord& movement : played->movements) {
    if (movement.request_id == 0) continue;
    const StepRequest& step = steps[movement.request_id - 1];
    const DVec3 fixed = movement.plants[0].anchor_m;
    const DVec3 landed = movement.plants.back().anchor_m;
    const DVec3 apart = RotateYaw(-movement.base.heading_rad, landed - fixed);
    EXPECT_NEAR(apart.z, step.length_m, 1e-3) << movement.request_id;
    EXPECT_NEAR(apart.y, step.height_m, 1e-3) << movement.request_id;
    EXPECT_NEAR(std::fabs(apart.x), step.side_m.value_or(std::fabs(apart.x)), 1e-3)
        << movement.request_id;
    EXPECT_LE(movement.landing_error_m, 1e-3) << movement.request_id;
    ++met;
  }
  EXPECT_EQ(met, 4);
}

TEST_F(ExactPlacement, ExcludesTheNearestAndRequiresFootPlanting) {
  const MovementRequest either{
      1, StepRequest{.length_m = 0.5, .exact_only = true, .allow_nearest = true}};
  EXPECT_EQ(avatar_.Enqueue(either).error().code, ErrorCode::kInvalidArgument);
  EXPECT_STREQ(avatar_.Enqueue(either).error().text, "exact_only excludes allow_nearest");
  AvatarSimulation sliding(library_, BaseFrame{}, {.foot_planting = false});
  const MovementRequest somewhere = StepOnto(1, Foot::kLeft, {0.1, 0.0, 0.4}, 0.0);
  EXPECT_EQ(sliding.Enqueue(somewhere).error().code, ErrorCode::kUnsupported);
  EXPECT_TRUE(sliding.Enqueue(StepOnto(1, Foot::kLeft, {0.1, 0.0, 0.4}, 0.0, false)).has_value());
  EXPECT_EQ(avatar_.Enqueue(StepOnto(1, Foot::kLeft, {0.0, 2e6, 0.0}, 0.0)).error().code,
            ErrorCode::kOutOfRange);
  EXPECT_EQ(avatar_.Enqueue(StepOnto(1, Foot::kLeft, {0.0, 0.0, 0.0}, NAN)).error().code,
            ErrorCode::kOutOfRange);
  EXPECT_EQ(avatar_.queue_size(), 0);
}

TEST_F(ExactPlacement, SynthesisReportsRejectedSteps) {
  const std::vector<MovementRequest> requests = {
      {1, StepRequest{.foot = Foot::kLeft, .length_m = 0.5}},
      StepOnto(2, Foot::kRight, {0.0, 0.0, 5.0}, 0.0),
      {3, StepRequest{.length_m = 0.5}}};
  const auto synthesis = Synthesize({.library = library_, .requests = requests});
  ASSERT_TRUE(synthesis.has_value());
  ASSERT_EQ(synthesis->skipped.size(), 1u);
  EXPECT_EQ(synthesis->skipped[0].request_id, 2u);
  EXPECT_GT(synthesis->skipped[0].missed.distance_m, 3.0);
  EXPECT_EQ(synthesis->skipped[0].time_s, synthesis->movements[1].start_s);
  EXPECT_EQ(synthesis->movements[1].request_id, 3u);
  EXPECT_TRUE(synthesis->walks.empty());
}

}  // namespace
}  // namespace stridewire
