// Foot planting is switched off and on at any time. Nothing may jump, and feet that are planted
// again must stand still.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "captured_library.h"
#include "random.h"
#include "random_walker.h"
#include "runtime/avatar/avatar_simulation.h"
#include "velocity_steps.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
constexpr double kFps = 60.0;
constexpr double kTickS = 1.0 / kFps;

MovementRequest RandomRequest(const RandomWalker& walker, const AvatarSimulation& avatar,
                              Random& random) {
  MovementRequest request{
      1, {}, random.Draw(0, 1) < 0.6 ? Interrupt::kNow : Interrupt::kAfterMovement};
  const double what = random.Draw(0.0, 1.0);
  if (what < 0.6) {
    request.movement = StepRequest{.length_m = random.Draw(0.0, walker.longest_m),
                                   .turn_rad = random.Draw(-0.4, 0.4)};
  } else if (what < 0.7) {
    request.movement = JumpRequest{.length_m = random.Draw(0.5, 1.5)};
  } else if (what < 0.8) {
    request.movement = StandRequest{random.Draw(0.0, 0.5)};
  } else {
    request.movement = WalkRequest{.position_m = {random.Draw(-4, 4), 0.0, random.Draw(-4, 4)},
                                   .heading_rad = random.Draw(-3, 3)};
  }
  if (!ValidateRequest(avatar.library(), request)) request.movement = StepRequest{.length_m = 0.3};
  return request;
}

enum Join { kStays, kGoesOff, kGoesOn };

struct Figures {
  int joins[3] = {};                // Movements that began, by Join.
  VelocityStep largest[3];          // Change of velocity in the poses around them.
  double largest_drift_m = 0.0;     // Drift of a planted foot.
  double largest_settling_m = 0.0;  // Drift of a planted foot during a plant fade.
};

// Measures one avatar after every frame.
class Observer {
 public:
  Observer(const AvatarSimulation& avatar, Figures& figures)
      : avatar_(avatar), figures_(figures), steps_(avatar.library().skeleton(), kFps) {}

  void Look() {
    for (const AvatarEvent& event : avatar_.events()) {
      if (event.type != AvatarEventType::kStarted || avatar_.movement() == nullptr) continue;
      const bool is_planted = avatar_.movement()->feet.is_active;
      join_ = is_planted == was_planted_ ? kStays : is_planted ? kGoesOn : kGoesOff;
      was_planted_ = is_planted;
      ++figures_.joins[join_];
      frames_since_join_ = 0;
    }
    const VelocityStep step = steps_.Add(avatar_.pose());
    if (frames_since_join_++ < kFramesOfJoin) {
      VelocityStep& largest = figures_.largest[join_];
      largest.joint_rad_s = std::max(largest.joint_rad_s, step.joint_rad_s);
      largest.root_m_s = std::max(largest.root_m_s, step.root_m_s);
    }
    LookAtFeet();
  }

 private:
  static constexpr int kFramesOfJoin = 3;  // A change of velocity affects three poses.

  void LookAtFeet() {
    const Movement* movement = avatar_.movement();
    if (movement == nullptr) return;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const auto f = static_cast<std::size_t>(foot);
      const bool stands = movement->feet.is_active &&
                          movement->feet.foot(foot).IsPlanted(avatar_.movement_time_s());
      const DVec3 ball(BallPosition(avatar_.library().skeleton(), avatar_.pose(), foot));
      if (stands && !stood_[f]) anchors_[f] = ball;
      if (stands) {
        const bool settles =
            avatar_.movement_time_s() < movement->start_offset_s + movement->feet.plant_fade_s;
        double& largest = settles ? figures_.largest_settling_m : figures_.largest_drift_m;
        largest = std::max(largest, std::hypot(ball.x - anchors_[f].x, ball.z - anchors_[f].z));
      }
      stood_[f] = stands;
    }
  }

  const AvatarSimulation& avatar_;
  Figures& figures_;
  VelocitySteps steps_;
  Join join_ = kStays;
  int frames_since_join_ = kFramesOfJoin;
  bool was_planted_ = true;
  DVec3 anchors_[2];
  bool stood_[2] = {false, false};
};

Figures SwitchAll(const RandomWalker& walker, const Library& library, double seconds,
                  unsigned seed) {
  Figures figures;
  for (int i = 0; i < kRandomWalkers; ++i) {
    Random random(seed + static_cast<unsigned>(i));
    AvatarSimulation avatar(library, BaseFrame{});
    Observer observer(avatar, figures);
    double next_request_s = 0.0;
    double next_switch_s = 0.0;
    for (int frame = 0; frame < static_cast<int>(seconds * kFps); ++frame) {
      const double now_s = frame / kFps;
      if (now_s >= next_switch_s) {
        next_switch_s = now_s + random.Draw(0.05, 2.0);
        EXPECT_TRUE(avatar.SetFootPlanting(!avatar.foot_planting()).has_value());
      }
      if (now_s >= next_request_s) {
        next_request_s = now_s + random.Draw(0.05, 1.6);
        EXPECT_TRUE(avatar.Enqueue(RandomRequest(walker, avatar, random)).has_value());
      }
      avatar.Advance(kTickS);
      observer.Look();
    }
  }
  return figures;
}

// Compares the largest change of velocity in some hundred transitions with that inside the
// examples. `climb_m_s` is the additional change due to moving onto the ground.
void ExpectNoJumps(const Figures& figures, const VelocityStep& examples, double climb_m_s = 0.0) {
  for (const Join join : {kGoesOff, kGoesOn}) {
    ASSERT_GT(figures.joins[join], 4 * kRandomWalkers);
    EXPECT_LE(figures.largest[join].joint_rad_s,
              std::max(1.5 * examples.joint_rad_s, 1.25 * figures.largest[kStays].joint_rad_s));
    EXPECT_LE(figures.largest[join].root_m_s,
              climb_m_s + std::max({0.5, 1.5 * examples.root_m_s,
                                    1.25 * figures.largest[kStays].root_m_s}));
  }
}

class SwitchPlanting : public testing::TestWithParam<RandomWalker> {};
INSTANTIATE_TEST_SUITE_P(Libraries, SwitchPlanting,
                         testing::Values(RandomWalker{"Builtin", {}, 0.75},
                                         RandomWalker{"Subject16", {"16"}, 0.75},
                                         RandomWalker{"Subject01", {"01"}, 0.58}),
                         [](const auto& walker) { return walker.param.name; });

TEST_P(SwitchPlanting, IsSmoothAtAnyTimeAndFeetStandStillAfterwards) {
  const RandomWalker& walker = GetParam();
  STRIDEWIRE_SKIP_WITHOUT_TAKES(walker.subjects);
  const Library library = LibraryOf(walker.subjects);
  const unsigned seed = 20261122;
  const Figures figures = SwitchAll(walker, library, 60.0, seed);
  const VelocityStep examples = LargestStepOfExamples(*LibraryOfAll(walker.subjects), kFps);
  std::printf(
      "%s: seed %u; %d movements began planted or not as before, %d no more, %d again; "
      "velocities step by at most %.2f rad/s %.2f m/s, %.2f %.2f, %.2f %.2f there (%.2f "
      "%.2f in the examples); planted feet drift %.4f mm, %.2f mm "
      "while it sets in\n",
      walker.name, seed, figures.joins[kStays], figures.joins[kGoesOff], figures.joins[kGoesOn],
      figures.largest[kStays].joint_rad_s, figures.largest[kStays].root_m_s,
      figures.largest[kGoesOff].joint_rad_s, figures.largest[kGoesOff].root_m_s,
      figures.largest[kGoesOn].joint_rad_s, figures.largest[kGoesOn].root_m_s, examples.joint_rad_s,
      examples.root_m_s, 1e3 * figures.largest_drift_m, 1e3 * figures.largest_settling_m);
  ExpectNoJumps(figures, examples);
  EXPECT_LE(figures.largest_drift_m, 1e-3);
  EXPECT_LE(figures.largest_settling_m, 5e-3);
}

// Without planting, a body walks through hills as if they did not exist, up to a metre deep.
TEST(SwitchPlantingOnHills, MovesFeetSmoothlyOntoTheGround) {
  const Library library = LibraryOf({});
  const unsigned seed = 20261122;
  HeightField field{.origin_m = {-50.0, -50.0}, .cell_m = 0.25, .columns = 401, .rows = 401};
  for (int row = 0; row < field.rows; ++row) {
    for (int column = 0; column < field.columns; ++column) {
      field.heights_m.push_back(
          static_cast<float>(0.5 * std::sin(0.05 * column) * std::cos(0.06 * row)));
    }
  }
  const auto ground = Terrain::Make({.height_field = std::move(field), .boxes = {}}).value();
  Figures figures;
  double deepest_m = 0.0;
  double worst_m = 0.0;
  int landings = 0;
  for (int i = 0; i < kRandomWalkers; ++i) {
    Random random(seed + static_cast<unsigned>(i));
    AvatarSimulation avatar(library, BaseFrame{}, {.terrain = ground});
    Observer observer(avatar, figures);
    int planted_steps = 0;
    for (int frame = 0; frame < 3600; ++frame) {
      if (frame % 300 == 0) {
        ASSERT_TRUE(avatar.SetFootPlanting(frame % 600 == 0).has_value());
      }
      if (avatar.queue_size() == 0) {
        ASSERT_TRUE(avatar
                        .Enqueue({1, StepRequest{.length_m = random.Draw(0.3, 0.7),
                                                 .turn_rad = random.Draw(-0.1, 0.1)}})
                        .has_value());
      }
      avatar.Advance(kTickS);
      observer.Look();
      for (const AvatarEvent& event : avatar.events()) {
        if (event.type != AvatarEventType::kFootStrike) continue;
        planted_steps = avatar.movement()->feet.is_active ? planted_steps + 1 : 0;
        const DVec3 at(event.position_m);
        const double off_m = std::fabs(at.y - library->leg_rig().sides[0].ball_height_m -
                                       ground->HeightAt(at.x, at.z));
        if (planted_steps == 0) deepest_m = std::max(deepest_m, off_m);
        if (planted_steps < 2) continue;
        worst_m = std::max(worst_m, off_m);
        ++landings;
      }
    }
  }
  std::printf(
      "hills: seed %u; %d switched off, %d on; velocities step by at most %.2f rad/s %.2f "
      "m/s, %.2f %.2f, %.2f %.2f there; feet up to %.2f m off the ground, %.3f m from the "
      "second planted landing on\n",
      seed, figures.joins[kGoesOff], figures.joins[kGoesOn], figures.largest[kStays].joint_rad_s,
      figures.largest[kStays].root_m_s, figures.largest[kGoesOff].joint_rad_s,
      figures.largest[kGoesOff].root_m_s, figures.largest[kGoesOn].joint_rad_s,
      figures.largest[kGoesOn].root_m_s, deepest_m, worst_m);
  EXPECT_GT(deepest_m, 0.3);
  ASSERT_GT(landings, 20 * kRandomWalkers);
  EXPECT_LE(worst_m, 0.05);  // Soles rest on the highest point of the ground below them.
  // The cubic that fades out a height over T starts with an acceleration of 6 / T^2 times the
  // height. On a slope, the planned movement lowers the root as well, by less than kSinkM.
  constexpr double kSinkM = 0.1;
  ExpectNoJumps(figures, LargestStepOfExamples(*library, kFps),
                6.0 * (deepest_m + kSinkM) / (kEaseOutS * kEaseOutS) * kTickS);
}

TEST(SwitchPlantingOff, RejectsNewAndQueuedExactPlacements) {
  AvatarSimulation avatar(LibraryOf({}), BaseFrame{});
  const MovementRequest must{
      2, StepRequest{.foot = Foot::kRight, .at = {{{-0.1, 0.0, 0.9}, 0.0}}, .exact_only = true}};
  ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.foot = Foot::kLeft, .length_m = 0.5}}).has_value());
  ASSERT_TRUE(avatar.Enqueue(must).has_value());
  avatar.Advance(kTickS);
  ASSERT_TRUE(avatar.SetFootPlanting(false).has_value());
  EXPECT_FALSE(avatar.foot_planting());
  EXPECT_TRUE(avatar.movement()->feet.is_active);  // Until the end of the movement.
  EXPECT_EQ(avatar.Enqueue(must).error().code, ErrorCode::kUnsupported);
  AvatarEvent rejected;
  for (int i = 0; i < 300 && !avatar.idle(); ++i) {
    avatar.Advance(kTickS);
    for (const AvatarEvent& event : avatar.events()) {
      if (event.type == AvatarEventType::kRejected) rejected = event;
    }
  }
  EXPECT_EQ(rejected.request_id, 2u);
  EXPECT_EQ(rejected.code, ErrorCode::kUnsupported);
  EXPECT_EQ(DescribeRejection(rejected), "exact placement requires foot planting");
  ASSERT_TRUE(avatar.SetFootPlanting(true).has_value());
  EXPECT_TRUE(avatar.Enqueue(must).has_value());
}

}  // namespace
}  // namespace stridewire
