#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "runtime/avatar/avatar_simulation.h"
#include "runtime/skeleton/foot_vector.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/open_library.h"
#include "test_library.h"

namespace stridewire {
namespace {

constexpr double kTickS = 1.0 / 60.0;

class AvatarTest : public testing::Test {
 protected:
  void Request(decltype(MovementRequest::movement) movement) {
    const Status status = avatar_.Enqueue({++last_id_, movement});
    ASSERT_TRUE(status.has_value()) << Describe(status.error());
  }
  // Advances until the avatar is idle and collects the events. Fails after 60 s.
  std::vector<AvatarEvent> RunUntilIdle() {
    std::vector<AvatarEvent> all;
    for (int tick = 0; tick < 3600; ++tick) {
      avatar_.Advance(kTickS);
      all.insert(all.end(), avatar_.events().begin(), avatar_.events().end());
      if (avatar_.idle()) return all;
    }
    ADD_FAILURE() << "never idle";
    return all;
  }
  std::vector<AvatarEvent> Of(const std::vector<AvatarEvent>& events, AvatarEventType type) {
    std::vector<AvatarEvent> found;
    for (const AvatarEvent& event : events) {
      if (event.type == type) found.push_back(event);
    }
    return found;
  }

  const std::shared_ptr<const MotionLibrary> library_ = MakeTestLibrary();
  AvatarSimulation avatar_{library_, {}};
  std::uint64_t last_id_ = 0;
};

TEST_F(AvatarTest, StandsAtTheGivenBaseFrame) {
  // Planting bends the straight legs of the test library a little.
  AvatarSimulation planted(library_, {{2.0, 1.0, -3.0}, M_PI / 2});
  EXPECT_NEAR(planted.pose().root_position_m.y, 1.9, 0.01);
  AvatarSimulation avatar(library_, {{2.0, 1.0, -3.0}, M_PI / 2}, {.foot_planting = false});
  EXPECT_NEAR(avatar.pose().root_position_m.x, 2.0, 1e-6);
  EXPECT_NEAR(avatar.pose().root_position_m.y, 1.9, 1e-6);
  const Vec3 before = avatar.pose().root_position_m;
  for (int i = 0; i < 100; ++i) avatar.Advance(kTickS);
  EXPECT_EQ(avatar.pose().root_position_m, before);
  EXPECT_TRUE(avatar.idle());
}

TEST_F(AvatarTest, ClosesItsFeetAfterAWalk) {
  for (int i = 0; i < 4; ++i) Request(StepRequest{.length_m = 0.4});
  const auto events = RunUntilIdle();
  const auto started = Of(events, AvatarEventType::kStarted);
  ASSERT_EQ(started.size(), 5u) << "four steps and a closing one";
  EXPECT_EQ(started[0].kind, MovementKind::kStepLeft);
  EXPECT_EQ(started[1].kind, MovementKind::kStepRight);
  EXPECT_EQ(started[4].request_id, 0u);
  EXPECT_EQ(Of(events, AvatarEventType::kFootStrike).size(), 5u);
  EXPECT_EQ(Of(events, AvatarEventType::kFinished).size(), 5u);
  EXPECT_EQ(Of(events, AvatarEventType::kIdle).size(), 1u);
  // The hips travel (0 + .4)/2 + 3 * .4 + .4/2.
  EXPECT_NEAR(avatar_.base().position_m.z, 1.6, 0.03);
  EXPECT_NEAR(avatar_.base().position_m.x, 0.0, 1e-6);
  const DVec3 feet = FootVector(library_->skeleton(), avatar_.pose(), Foot::kLeft, 0.0);
  EXPECT_NEAR(feet.z, 0.0, 0.01);
}

TEST_F(AvatarTest, PoseIsContinuousBetweenMovements) {
  Request(StepRequest{.length_m = 0.5});
  Request(StepRequest{.length_m = 0.2});
  // Stepping twice with the same foot makes a rough transition.
  Request(StepRequest{.foot = Foot::kRight, .length_m = 0.6});
  Request(JumpRequest{.length_m = 1.0});
  const auto Copy = [](ConstPoseSpan from, Pose& to) {
    to.root_position_m = from.root_position_m;
    to.rotations.assign(from.rotations.begin(), from.rotations.end());
  };
  Pose last(7);
  Copy(avatar_.pose(), last);
  double largest_rad = 0.0;
  float largest_m = 0.0f;
  while (true) {
    avatar_.Advance(1.0 / 600.0);
    largest_rad = std::max(largest_rad, LargestJointAngle(avatar_.pose(), last));
    largest_m =
        std::max(largest_m, glm::length(avatar_.pose().root_position_m - last.root_position_m));
    Copy(avatar_.pose(), last);
    if (avatar_.idle()) break;
  }
  EXPECT_LT(largest_rad, 0.03);  // 18 rad/s.
  EXPECT_LT(largest_m, 0.015f);
}

TEST_F(AvatarTest, ClosesItsFeetBeforeAJumpAndAStand) {
  Request(StepRequest{.length_m = 0.4});
  Request(JumpRequest{.length_m = 0.6});
  Request(StepRequest{.length_m = 0.4});
  Request(StandRequest{.seconds = 0.5});
  const auto started = Of(RunUntilIdle(), AvatarEventType::kStarted);
  ASSERT_EQ(started.size(), 6u);
  EXPECT_EQ(started[1].request_id, 0u);
  EXPECT_EQ(started[2].kind, MovementKind::kJump);
  EXPECT_EQ(started[4].request_id, 0u);
  EXPECT_EQ(started[5].kind, MovementKind::kStand);
}

TEST_F(AvatarTest, CarriesRemainingTimeToTheNextMovement) {
  // Ten equal steps take as long as their durations, whatever the length of a tick.
  for (const double dt : {1.0 / 60.0, 1.0 / 37.0, 0.4}) {
    AvatarSimulation avatar(library_, {});
    for (int i = 0; i < 10; ++i) {
      ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.4}}).has_value());
    }
    std::vector<double> ends;
    while (!avatar.idle()) {
      avatar.Advance(dt);
      for (const AvatarEvent& event : avatar.events()) {
        if (event.type == AvatarEventType::kFinished) ends.push_back(event.time_s);
      }
    }
    ASSERT_EQ(ends.size(), 11u);
    EXPECT_NEAR(ends[9] - ends[1], 8 * 0.58, 0.05) << dt;
  }
}

TEST_F(AvatarTest, ReportsClampedAndExtrapolatedRequests) {
  Request(StepRequest{.length_m = 5.0, .allow_nearest = true});
  const auto started = Of(RunUntilIdle(), AvatarEventType::kStarted);
  EXPECT_TRUE(started[0].clamped);
  EXPECT_TRUE(started[0].extrapolated);
  EXPECT_DOUBLE_EQ(started[0].requested.values[1], 5.0);
  EXPECT_LT(started[0].applied.values[1], 0.7);
}

// A request that the library cannot meet is rejected before it plays, and the next one is played.
TEST_F(AvatarTest, RejectsRequestsOutOfReach) {
  Request(StepRequest{.length_m = 5.0});
  Request(StepRequest{.length_m = -0.5});
  Request(StepRequest{.length_m = 0.3, .height_m = 0.3});
  Request(StepRequest{.length_m = 0.3, .turn_rad = 1.5});
  Request(JumpRequest{.length_m = 4.0});
  Request(StepRequest{.at = FootprintRequest{DVec3(0.1, 0.0, 3.0), 0.0}});
  Request(StepRequest{.length_m = 0.4});
  const auto events = RunUntilIdle();
  const auto rejected = Of(events, AvatarEventType::kRejected);
  ASSERT_EQ(rejected.size(), 6u);
  for (std::size_t i = 0; i < rejected.size(); ++i) {
    EXPECT_EQ(rejected[i].request_id, i + 1);
    EXPECT_EQ(rejected[i].code, ErrorCode::kOutOfRange);
    ASSERT_TRUE(rejected[i].missed.has_value());
    EXPECT_LE(DescribeRejection(rejected[i]).size(), 200u);
  }
  const FootprintError& too_long = *rejected[0].missed;
  EXPECT_DOUBLE_EQ(too_long.requested.length_m, 5.0);
  EXPECT_LT(too_long.reached.length_m, 0.7);
  EXPECT_NEAR(too_long.distance_m, 5.0 - too_long.reached.length_m, 1e-9);
  EXPECT_EQ(DescribeRejection(rejected[0])
                .find("the step is out of reach: requested length 5 m; "
                      "nearest length 0."),
            0u)
      << DescribeRejection(rejected[0]);
  EXPECT_GT(rejected[3].missed->turn_rad, kMaxRequestErrorRad);
  EXPECT_TRUE(rejected[5].missed->is_footprint);
  EXPECT_EQ(DescribeRejection(rejected[5]).find("the footprint is out of reach: the left foot"),
            0u);
  const auto started = Of(events, AvatarEventType::kStarted);
  ASSERT_FALSE(started.empty());
  EXPECT_EQ(started[0].request_id, 7u);
  EXPECT_NEAR(started[0].time_s, 0.0, 1e-9);
}

TEST_F(AvatarTest, ReportsHowFastItWalked) {
  const WalkSpeeds speeds = MeasureWalkSpeeds(library_);
  EXPECT_GT(speeds.slowest_m_s, 0.05);
  EXPECT_GT(speeds.fastest_m_s, 1.5 * speeds.slowest_m_s);
  EXPECT_LT(speeds.fastest_m_s, 3.0);
  const double between_m_s = 0.5 * (speeds.slowest_m_s + speeds.fastest_m_s);
  EXPECT_EQ(speeds.Nearest(between_m_s), between_m_s);
  EXPECT_EQ(speeds.Nearest(5.0), speeds.fastest_m_s);
  EXPECT_EQ(speeds.Nearest(0.05), speeds.slowest_m_s);
  EXPECT_FALSE(speeds.IsOutside(between_m_s));
  EXPECT_FALSE(speeds.IsOutside(1.04 * speeds.fastest_m_s));
  EXPECT_TRUE(speeds.IsOutside(1.06 * speeds.fastest_m_s));
  EXPECT_TRUE(speeds.IsOutside(0.05));
  EXPECT_FALSE(WalkSpeeds{}.IsOutside(1.0));
  EXPECT_EQ(WalkSpeeds{}.Nearest(1.0), 0.0);

  Request(WalkRequest{.position_m = DVec3(0.0, 0.0, 6.0), .speed_m_s = between_m_s});
  Request(WalkRequest{.position_m = DVec3(0.0, 0.0, 12.0), .speed_m_s = 5.0});
  Request(WalkRequest{.position_m = DVec3(0.0, 0.0, 12.0)});
  std::vector<AvatarEvent> ends;
  for (const AvatarEvent& event : RunUntilIdle()) {
    const bool is_end = event.type == AvatarEventType::kFinished && event.group < 0;
    if (is_end) {
      ends.push_back(event);
    } else {
      EXPECT_EQ(event.speed_m_s, 0.0);
    }
  }
  ASSERT_EQ(ends.size(), 3u);
  EXPECT_NEAR(ends[0].speed_m_s, between_m_s, 0.05 * between_m_s);
  EXPECT_NEAR(ends[1].speed_m_s, speeds.fastest_m_s, 0.05 * speeds.fastest_m_s);
  EXPECT_EQ(ends[2].speed_m_s, 0.0) << "the avatar was there already";
}

// Inserted steps do not help a request that is out of reach, so the avatar does not move.
TEST_F(AvatarTest, DoesNotStepForARequestOutOfReach) {
  Request(StepRequest{.length_m = 0.4});
  Request(JumpRequest{.length_m = 4.0});
  const auto started = Of(RunUntilIdle(), AvatarEventType::kStarted);
  ASSERT_EQ(started.size(), 2u) << "the step and the one that brings the feet together";
  EXPECT_EQ(started[0].request_id, 1u);
  EXPECT_EQ(started[1].request_id, 0u);
}

TEST_F(AvatarTest, ReportsParametersThatTheLibraryLacks) {
  Request(StepRequest{.length_m = 0.3, .height_m = 0.2, .turn_rad = 0.5, .allow_nearest = true});
  const auto started = Of(RunUntilIdle(), AvatarEventType::kStarted);
  EXPECT_TRUE(started[0].clamped);
}

TEST_F(AvatarTest, LongWalkStaysStraightAndLevel) {
  for (int i = 0; i < 200; ++i) {
    Request(StepRequest{.length_m = 0.2 + 0.4 * ((i * 7) % 11) / 10.0});
  }
  float lowest = 9.0f;
  float highest = 0.0f;
  while (!avatar_.idle()) {
    avatar_.Advance(kTickS);
    lowest = std::min(lowest, avatar_.pose().root_position_m.y);
    highest = std::max(highest, avatar_.pose().root_position_m.y);
  }
  EXPECT_EQ(avatar_.base().heading_rad, 0.0);
  EXPECT_NEAR(avatar_.base().position_m.x, 0.0, 1e-5);
  EXPECT_EQ(avatar_.base().position_m.y, 0.0);
  EXPECT_GT(lowest, 0.8f);
  EXPECT_LT(highest, 0.92f);
}

TEST_F(AvatarTest, RejectsInvalidRequests) {
  const auto code = [&](decltype(MovementRequest::movement) movement) {
    const Status status = avatar_.Enqueue({1, movement});
    return status ? "none" : std::string(ErrorCodeName(status.error().code));
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(code(StepRequest{.length_m = nan}), "out_of_range");
  EXPECT_EQ(code(StepRequest{.length_m = 11.0}), "out_of_range");
  EXPECT_EQ(code(StepRequest{.length_m = 0.3, .side_m = nan}), "out_of_range");
  EXPECT_EQ(code(StepRequest{.length_m = 0.3, .height_m = -20.0}), "out_of_range");
  EXPECT_EQ(code(StepRequest{.length_m = 0.3, .turn_rad = 4.0}), "out_of_range");
  EXPECT_EQ(code(JumpRequest{.length_m = nan}), "out_of_range");
  EXPECT_EQ(code(StandRequest{.seconds = -1.0}), "out_of_range");
  EXPECT_EQ(code(StandRequest{.seconds = nan}), "out_of_range");
  EXPECT_EQ(avatar_.queue_size(), 0);
}

TEST_F(AvatarTest, QueueIsBounded) {
  for (int i = 0; i < AvatarSimulation::kMaxQueue; ++i) Request(StandRequest{.seconds = 0.0});
  const Status status = avatar_.Enqueue({1, StandRequest{}});
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().code, ErrorCode::kLimitExceeded);
  // A thousand stands of 0 s in one tick must not overflow the event list.
  const auto events = RunUntilIdle();
  EXPECT_EQ(Of(events, AvatarEventType::kFinished).size(),
            std::size_t{AvatarSimulation::kMaxQueue});
}

TEST_F(AvatarTest, CancelQueueKeepsTheCurrentMovement) {
  for (int i = 0; i < 5; ++i) Request(StepRequest{.length_m = 0.4});
  avatar_.Advance(kTickS);
  EXPECT_EQ(avatar_.CancelQueue(), 4);
  EXPECT_EQ(Of(RunUntilIdle(), AvatarEventType::kFinished).size(), 2u);
}

TEST_F(AvatarTest, RejectsKindsThatTheLibraryLacks) {
  RawLibrary raw = MakeTestRawLibrary();
  raw.groups.pop_back();
  raw.groups.pop_back();
  LibraryBuilder builder;
  const auto only_left = builder.Build(raw);
  ASSERT_TRUE(only_left.has_value());
  AvatarSimulation avatar(*only_left, {});
  const auto code = [&](decltype(MovementRequest::movement) movement) {
    const Status status = avatar.Enqueue({1, movement});
    return status ? "none" : std::string(ErrorCodeName(status.error().code));
  };
  EXPECT_EQ(code(JumpRequest{.length_m = 0.5}), "unsupported");
  EXPECT_EQ(code(StepRequest{.foot = Foot::kRight, .length_m = 0.5}), "unsupported");
  EXPECT_EQ(code(StepRequest{.length_m = 0.5}), "none");
  for (int i = 0; i < 200; ++i) avatar.Advance(kTickS);
  EXPECT_TRUE(avatar.idle());
}

TEST_F(AvatarTest, StartDelayAppliesOnlyWhileStanding) {
  const auto ticks_until = [&](auto is_so) {
    int ticks = 0;
    for (; ticks < 1000 && !is_so(); ++ticks) avatar_.Advance(kTickS);
    return ticks;
  };
  const auto begun = [&](std::uint64_t id) {
    return avatar_.started() != nullptr && avatar_.started()->request_id == id;
  };
  const auto ask = [&](std::uint64_t id, int delay_ticks, Interrupt interrupt = Interrupt::kNone) {
    EXPECT_TRUE(
        avatar_.Enqueue({id, StepRequest{.length_m = 0.4}, interrupt}, delay_ticks * kTickS));
  };
  ask(1, 5);
  ask(2, 100);  // It follows another movement, so it is not delayed.
  EXPECT_EQ(ticks_until([&] { return begun(1); }), 6);
  const double duration_s = avatar_.movement()->duration_s();
  EXPECT_NEAR(ticks_until([&] { return begun(2); }) * kTickS, duration_s, 2 * kTickS);
  ask(3, 100);
  EXPECT_LT(ticks_until([&] { return begun(3); }), 90);
  ticks_until([&] { return avatar_.idle(); });

  // Repeating the request does not extend its delay, and a shorter delay replaces a longer one.
  ask(4, 10, Interrupt::kNow);
  for (int i = 0; i < 5; ++i) avatar_.Advance(kTickS);
  ask(5, 10, Interrupt::kNow);
  EXPECT_EQ(ticks_until([&] { return begun(5); }), 6);
  ticks_until([&] { return avatar_.idle(); });
  ask(6, 10);
  ask(7, 0, Interrupt::kNow);
  EXPECT_EQ(ticks_until([&] { return begun(7); }), 1);

  // The current movement is not interrupted before the delay has passed.
  avatar_.Advance(kTickS);
  ask(8, 4, Interrupt::kNow);
  EXPECT_EQ(ticks_until([&] { return begun(8); }), 5);
}

// The feet of this library cannot be planted, so they stay where the blend puts them. Under
// sanitizers, the test also checks that no uninitialized data is read.
TEST_F(AvatarTest, DoesNotPlantFeetIfTheLegsShareAnAnkle) {
  RawLibrary raw = MakeTestRawLibrary();
  raw.skeleton.legs[0].ankle = raw.skeleton.legs[1].ankle;
  LibraryBuilder builder;
  const auto library = builder.Build(raw);
  ASSERT_TRUE(library.has_value());
  ASSERT_FALSE((*library)->leg_rig().is_usable);
  AvatarSimulation avatar(*library, {});
  EXPECT_FALSE(avatar.foot_planting());
  EXPECT_EQ(avatar.SetFootPlanting(true).error().code, ErrorCode::kUnsupported);
  EXPECT_TRUE(avatar.SetFootPlanting(false).has_value());
  ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.5}}).has_value());
  for (int i = 0; i < 200; ++i) avatar.Advance(kTickS);
  EXPECT_TRUE(avatar.idle());
  EXPECT_GT(avatar.pose().root_position_m.z, 0.1f);
}

// A server evaluates a pose only if a client needs it.
TEST(AvatarSimulation, MovesAlikeWhetherPosesAreEvaluatedOrNot) {
  const auto library = OpenLibrary("builtin").value();
  PlanScratch scratch(*library);
  for (int interrupted = 12; interrupted < 40; interrupted += 3) {
    AvatarSimulation evaluated(library, BaseFrame{}, {.foot_planting = false});
    AvatarSimulation state_only(library, BaseFrame{}, {.foot_planting = false});
    AvatarSimulation* const one = &state_only;
    for (int tick = 0; tick < 120; ++tick) {
      for (AvatarSimulation* avatar : {&evaluated, one}) {
        if (tick == 0) {
          ASSERT_TRUE(avatar->Enqueue({.movement = StepRequest{.foot = Foot::kLeft}}));
        } else if (tick == interrupted) {
          ASSERT_TRUE(avatar->Enqueue(
              {.movement = StepRequest{.foot = Foot::kLeft, .at = {{{0.15, 0.0, 0.5}, 0.1}}},
               .interrupt = Interrupt::kNow}));
        }
      }
      evaluated.Advance(1.0 / 60.0);
      AvatarSimulation::AdvanceStates({&one, 1}, 1.0 / 60.0, scratch, nullptr);
      ASSERT_EQ(evaluated.movement_time_s(), state_only.movement_time_s()) << tick;
    }
    state_only.UpdatePose();
    EXPECT_EQ(evaluated.pose().root_position_m, state_only.pose().root_position_m) << interrupted;
    EXPECT_TRUE(std::ranges::equal(evaluated.pose().rotations, state_only.pose().rotations));
  }
}

// A moving avatar is event-free between its events. A request that changes the current movement
// ends the event-free time at once. No event may occur while the avatar is event-free.
TEST(AvatarSimulation, IsEventFreeOnlyWithoutEvents) {
  const auto library = OpenLibrary("builtin").value();
  AvatarSimulation avatar(library, {});
  PlanScratch scratch(*library);
  EXPECT_FALSE(avatar.is_event_free());
  for (int i = 0; i < 4; ++i)
    ASSERT_TRUE(avatar.Enqueue({.movement = StepRequest{.length_m = 0.5}}));
  int quiet = 0;
  int eventful = 0;
  const auto advance = [&] {
    AvatarSimulation* const one = &avatar;
    std::vector<std::uint32_t> places{7};
    const std::uint64_t revision = avatar.revision();
    const double time_s = avatar.time_s();
    AvatarSimulation::AdvanceStates({&one, 1}, 1.0 / 60.0, scratch, &places);
    EXPECT_EQ(avatar.time_s(), time_s + 1.0 / 60.0);
    EXPECT_EQ(places.empty(), avatar.is_event_free());
    if (!avatar.is_event_free()) {
      eventful += !avatar.events().empty();
      return;
    }
    ++quiet;
    EXPECT_TRUE(avatar.events().empty());
    EXPECT_EQ(avatar.change(), AvatarChange{});
    EXPECT_EQ(avatar.revision(), revision);
    EXPECT_NE(avatar.movement(), nullptr);
    EXPECT_TRUE(avatar.layers().empty());
    EXPECT_FALSE(avatar.idle());
  };
  const auto walk_on = [&] {
    for (int tick = 0; tick < 60 && !avatar.is_event_free(); ++tick) advance();
    EXPECT_TRUE(avatar.is_event_free());
  };
  for (int tick = 0; tick < 100; ++tick) advance();
  EXPECT_GT(quiet, 60);
  EXPECT_GE(eventful, 4);  // Two steps start and two feet land.

  walk_on();
  ASSERT_TRUE(avatar.Enqueue({.movement = StepRequest{}, .interrupt = Interrupt::kNow}));
  EXPECT_FALSE(avatar.is_event_free());
  ASSERT_TRUE(avatar.Enqueue({.movement = StepRequest{}}));
  walk_on();
  ASSERT_TRUE(avatar.SetLayer({.layer = 0}));
  EXPECT_FALSE(avatar.is_event_free());
  advance();
  EXPECT_FALSE(avatar.is_event_free());
  avatar.Teleport({});
  EXPECT_FALSE(avatar.is_event_free());
}

}  // namespace
}  // namespace stridewire
