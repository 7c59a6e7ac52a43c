// Requests that interrupt a movement at any time. No joint may change its speed abruptly, and no
// standing foot may slide.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>

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
                              std::uint64_t id, Random& random) {
  MovementRequest request{
      id, {}, random.Draw(0, 1) < 0.8 ? Interrupt::kNow : Interrupt::kAfterMovement};
  const double what = random.Draw(0.0, 1.0);
  if (what < 0.6) {
    StepRequest step;
    if (random.Draw(0, 1) < 0.5) step.foot = random.Draw(0, 1) < 0.5 ? Foot::kLeft : Foot::kRight;
    step.length_m = random.Draw(0.0, walker.longest_m);
    step.turn_rad = random.Draw(-0.4, 0.4);
    request.movement = step;
  } else if (what < 0.7) {
    request.movement = JumpRequest{.length_m = random.Draw(0.5, 1.5)};
  } else if (what < 0.8) {
    request.movement = StandRequest{random.Draw(0.0, 0.5)};
  } else {
    WalkRequest walk;
    walk.position_m = {random.Draw(-4, 4), 0.0, random.Draw(-4, 4)};
    walk.heading_rad = random.Draw(-3, 3);
    request.movement = walk;
  }
  if (!ValidateRequest(avatar.library(), request)) request.movement = StepRequest{.length_m = 0.3};
  return request;
}

struct Figures {
  int requests = 0;  // Requests during a movement.
  int cut_short = 0;
  double largest_drift_m = 0.0;   // Drift of a standing foot.
  std::vector<double> at_cuts;    // Largest change of angular velocity at each interrupt, rad/s.
  double largest_at_joins = 0.0;  // The same at every start of a movement.
  double largest_elsewhere = 0.0;
};

// Measures one avatar after every frame.
class Observer {
 public:
  Observer(const AvatarSimulation& avatar, Figures& figures)
      : avatar_(avatar), figures_(figures), steps_(avatar.library().skeleton(), kFps) {}

  void Look() {
    for (const AvatarEvent& event : avatar_.events()) {
      if (event.type != AvatarEventType::kFinished) continue;
      frames_since_join_ = 0;
      if (!event.is_cut_short) continue;
      ++figures_.cut_short;
      frames_since_cut_ = 0;
      at_cut_ = 0.0;
    }
    LookAtJoints();
    LookAtFeet();
  }

 private:
  static constexpr int kFramesOfJoin = 3;  // A change of velocity affects three poses.

  // A change of velocity within a movement that is played at a rate other than 1 is that of the
  // examples times the square of the rate. Dividing by it makes the figures comparable.
  void LookAtJoints() {
    if (avatar_.movement() != nullptr) rates_ = {rates_[1], avatar_.movement()->rate};
    const double rate = std::max(rates_[0], rates_[1]);
    const double step = steps_.Add(avatar_.pose()).joint_rad_s / (rate * rate);
    double& largest =
        frames_since_join_ < kFramesOfJoin ? figures_.largest_at_joins : figures_.largest_elsewhere;
    largest = std::max(largest, step);
    at_cut_ = std::max(at_cut_, step);
    ++frames_since_join_;
    if (++frames_since_cut_ == kFramesOfJoin) figures_.at_cuts.push_back(at_cut_);
  }

  void LookAtFeet() {
    for (int f = 0; f < 2; ++f) {
      const auto foot = static_cast<Foot>(f);
      const Movement* movement = avatar_.movement();
      const bool stands =
          movement == nullptr || movement->feet.foot(foot).IsPlanted(avatar_.movement_time_s());
      const DVec3 ball(BallPosition(avatar_.library().skeleton(), avatar_.pose(), foot));
      if (stands && !stood_[f]) anchors_[f] = ball;
      if (stands) {
        figures_.largest_drift_m = std::max(
            figures_.largest_drift_m, std::hypot(ball.x - anchors_[f].x, ball.z - anchors_[f].z));
      }
      stood_[f] = stands;
    }
  }

  const AvatarSimulation& avatar_;
  Figures& figures_;
  VelocitySteps steps_;
  int frames_since_join_ = 0;
  int frames_since_cut_ = kFramesOfJoin;
  double at_cut_ = 0.0;
  std::array<double, 2> rates_{1.0, 1.0};  // Rates of the movements in the last two frames.
  DVec3 anchors_[2];
  bool stood_[2] = {false, false};
};

Figures InterruptAll(const RandomWalker& walker, const Library& library, BlendKind blend,
                     int avatars, double seconds, unsigned seed) {
  Figures figures;
  for (int i = 0; i < avatars; ++i) {
    Random random(seed + static_cast<unsigned>(i));
    AvatarSimulation avatar(library, BaseFrame{}, {.blend = blend});
    Observer observer(avatar, figures);
    double next_s = 0.0;
    std::uint64_t id = 0;
    for (int frame = 0; frame < static_cast<int>(seconds * kFps); ++frame) {
      if (frame / kFps >= next_s) {
        next_s = frame / kFps + random.Draw(0.05, 1.2);
        figures.requests += avatar.movement() != nullptr;
        EXPECT_TRUE(avatar.Enqueue(RandomRequest(walker, avatar, ++id, random)).has_value());
      }
      avatar.Advance(kTickS);
      observer.Look();
    }
  }
  std::ranges::sort(figures.at_cuts);
  return figures;
}

class InterruptLibraries : public testing::TestWithParam<RandomWalker> {};
INSTANTIATE_TEST_SUITE_P(Libraries, InterruptLibraries,
                         testing::Values(RandomWalker{"Builtin", {}, 0.75},
                                         RandomWalker{"Subject16", {"16"}, 0.75},
                                         RandomWalker{"Subject01", {"01"}, 0.58}),
                         [](const auto& walker) { return walker.param.name; });

TEST_P(InterruptLibraries, IsSmoothAtAnyTime) {
  const RandomWalker& walker = GetParam();
  STRIDEWIRE_SKIP_WITHOUT_TAKES(walker.subjects);
  const Library library = LibraryOf(walker.subjects);
  const unsigned seed = 20261122;
  const char* asked = std::getenv("STRIDEWIRE_AVATARS");
  const int avatars = asked == nullptr ? kRandomWalkers : std::atoi(asked);
  const double examples = LargestStepOfExamples(*LibraryOfAll(walker.subjects), kFps).joint_rad_s;
  for (const BlendKind blend : {BlendKind::kCubic, BlendKind::kInertialization}) {
    const Figures figures = InterruptAll(walker, library, blend, avatars, 60.0, seed);
    ASSERT_GT(figures.at_cuts.size(), 5u * static_cast<unsigned>(avatars));
    std::printf(
        "%s, %s: seed %u, %d avatars, %d requests in mid-movement, %d cut short; drift %.4f mm; "
        "joints step by "
        "%.2f rad/s at interrupts (median; 99th percentile %.2f), at most %.2f where "
        "movements begin, "
        "%.2f elsewhere, %.2f in the examples (ratio %.2f)\n",
        walker.name, blend == BlendKind::kCubic ? "cubic" : "inertial", seed, avatars,
        figures.requests, figures.cut_short, 1e3 * figures.largest_drift_m,
        figures.at_cuts[figures.at_cuts.size() / 2],
        figures.at_cuts[figures.at_cuts.size() * 99 / 100], figures.largest_at_joins,
        figures.largest_elsewhere, examples, figures.largest_at_joins / examples);
    EXPECT_LE(figures.largest_drift_m, 1e-3);
    if (blend == BlendKind::kInertialization) {
      EXPECT_LE(figures.largest_at_joins, 1.5 * examples);
    }
  }
}

class InterruptBuiltin : public testing::Test {
 protected:
  // Advances until `done` returns true, or for 20 s. Returns the events.
  template <typename Done>
  std::vector<AvatarEvent> AdvanceUntil(const Done& done) {
    std::vector<AvatarEvent> events;
    for (int i = 0; i < 1200; ++i) {
      avatar_.Advance(kTickS);
      events.insert(events.end(), avatar_.events().begin(), avatar_.events().end());
      if (done()) return events;
    }
    ADD_FAILURE() << "never";
    return events;
  }
  void SwingTheLeftFoot() {
    ASSERT_TRUE(
        avatar_.Enqueue({1, StepRequest{.foot = Foot::kLeft, .at = {{{0.1, 0.0, 0.5}, 0.0}}}})
            .has_value());
    AdvanceUntil([&] {
      return avatar_.movement() != nullptr &&
             !avatar_.movement()->feet.foot(Foot::kLeft).IsPlanted(avatar_.movement_time_s());
    });
    for (int i = 0; i < 6; ++i) avatar_.Advance(kTickS);
  }
  void InterruptWith(decltype(MovementRequest::movement) movement,
                     Interrupt interrupt = Interrupt::kNow) {
    ASSERT_TRUE(avatar_.Enqueue({2, std::move(movement), interrupt}).has_value());
  }

  AvatarSimulation avatar_{OpenLibrary("builtin").value(), BaseFrame{}};
};

using Type = AvatarEventType;

TEST_F(InterruptBuiltin, RedirectsASwingToItsNewFootprint) {
  SwingTheLeftFoot();
  InterruptWith(StepRequest{.at = {{{0.22, 0.0, 0.4}, 0.2}}});
  avatar_.Advance(kTickS);
  ASSERT_EQ(avatar_.events().size(), 2u);
  EXPECT_EQ(avatar_.events()[0].type, Type::kFinished);
  EXPECT_EQ(avatar_.events()[0].request_id, 1u);
  EXPECT_TRUE(avatar_.events()[0].is_cut_short);
  EXPECT_EQ(avatar_.events()[1].type, Type::kStarted);
  EXPECT_EQ(avatar_.events()[1].request_id, 2u);
  EXPECT_GT(avatar_.movement()->start_offset_s, 0.0);
  // The foot may rest less than a tick before the end of the movement.
  AdvanceUntil([&] {
    return avatar_.movement() == nullptr ||
           avatar_.movement()->feet.foot(Foot::kLeft).land_s <= avatar_.movement_time_s();
  });
  const Vec3 ball = BallPosition(avatar_.library().skeleton(), avatar_.pose(), Foot::kLeft);
  EXPECT_NEAR(ball.x, 0.22, 1e-3);
  EXPECT_NEAR(ball.z, 0.4, 1e-3);
}

TEST_F(InterruptBuiltin, OtherFootStepsAfterTheLanding) {
  SwingTheLeftFoot();
  const double duration_s = avatar_.movement()->duration_s();
  const double land_s = avatar_.movement()->feet.foot(Foot::kLeft).land_s;
  const double now_s = avatar_.movement_time_s();
  InterruptWith(StepRequest{.foot = Foot::kRight, .length_m = 0.5});
  const auto events = AdvanceUntil([&] { return avatar_.started()->request_id == 2; });
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0].type, Type::kFootStrike);
  EXPECT_EQ(events[1].type, Type::kFinished);
  EXPECT_TRUE(events[1].is_cut_short);
  EXPECT_NEAR(events[2].time_s - events[0].time_s, 0.08, 0.03);
  EXPECT_LT(land_s, duration_s);
  EXPECT_GT(land_s, now_s);
}

TEST_F(InterruptBuiltin, CancelsAStepBeforeTheFootLeavesTheGround) {
  ASSERT_TRUE(avatar_.Enqueue({1, StepRequest{.foot = Foot::kLeft, .length_m = 0.5}}).has_value());
  avatar_.Advance(kTickS);
  const Vec3 stood = BallPosition(avatar_.library().skeleton(), avatar_.pose(), Foot::kLeft);
  InterruptWith(StepRequest{.foot = Foot::kRight, .length_m = 0.5});
  avatar_.Advance(kTickS);
  EXPECT_EQ(avatar_.started()->request_id, 2u);
  EXPECT_EQ(avatar_.started()->kind, MovementKind::kStepRight);
  AdvanceUntil([&] { return avatar_.movement_time_s() > 0.8 * avatar_.movement()->duration_s(); });
  const Vec3 stands = BallPosition(avatar_.library().skeleton(), avatar_.pose(), Foot::kLeft);
  EXPECT_NEAR(std::hypot(stands.x - stood.x, stands.z - stood.z), 0.0, 1e-4);
}

TEST_F(InterruptBuiltin, CompletesAJumpInProgress) {
  ASSERT_TRUE(avatar_.Enqueue({1, JumpRequest{.length_m = 1.0}}).has_value());
  avatar_.Advance(kTickS);
  InterruptWith(StepRequest{.length_m = 0.5});
  const auto events = AdvanceUntil([&] { return avatar_.started()->request_id == 2; });
  EXPECT_EQ(std::ranges::count(events, Type::kFootStrike, &AvatarEvent::type), 2);
  EXPECT_GT(BallPosition(avatar_.library().skeleton(), avatar_.pose(), Foot::kLeft).z, 0.9);
}

TEST_F(InterruptBuiltin, DelayedInterruptsFinishTheMovement) {
  ASSERT_TRUE(avatar_.Enqueue({1, StepRequest{.length_m = 0.5}}).has_value());
  ASSERT_TRUE(avatar_.Enqueue({1, StepRequest{.length_m = 0.5}}).has_value());
  avatar_.Advance(kTickS);
  InterruptWith(StepRequest{.length_m = 0.3}, Interrupt::kAfterMovement);
  EXPECT_EQ(avatar_.queue_size(), 1);
  const auto events = AdvanceUntil([&] { return avatar_.idle(); });
  EXPECT_EQ(std::ranges::count(events, true, &AvatarEvent::is_cut_short), 0);
  EXPECT_EQ(std::ranges::count_if(events,
                                  [](const AvatarEvent& event) {
                                    return event.type == Type::kFinished && event.request_id == 1;
                                  }),
            1);
}

// How an avatar that walks in steps of 0.6 m answers a request that interrupts it.
struct Response {
  double time_s = 0.0;           // Until the avatar has done what the request asks.
  double largest_drift_m = 0.0;  // Drift of a standing foot until then.
};

class ResponseBuiltin : public testing::Test {
 protected:
  // Returns the responses at 28 phases of a walk, the fastest first. `is_done` returns true when
  // the avatar has done what the request asks.
  template <typename Request, typename IsDone>
  std::vector<Response> Respond(const Request& request_of, const IsDone& is_done) const {
    std::vector<Response> responses;
    for (int phase = 0; phase < 28; ++phase) {
      AvatarSimulation avatar(library_, BaseFrame{});
      for (std::uint64_t id = 1; id <= 10; ++id) {
        EXPECT_TRUE(avatar.Enqueue({id, StepRequest{.length_m = 0.6}}).has_value());
      }
      for (int i = 0; i < 180 + 3 * phase; ++i) avatar.Advance(kTickS);
      EXPECT_TRUE(avatar.Enqueue({100, request_of(avatar), Interrupt::kNow}).has_value());
      Figures figures;
      Observer observer(avatar, figures);
      int ticks = 0;
      Vec3 root = avatar.pose().root_position_m;
      double speed_m_s = 0.0;
      do {
        avatar.Advance(kTickS);
        observer.Look();
        const Vec3 moved = avatar.pose().root_position_m - root;
        root = avatar.pose().root_position_m;
        speed_m_s = std::hypot(moved.x, moved.z) / kTickS;
      } while (++ticks < 600 && !is_done(avatar, speed_m_s));
      responses.push_back({ticks * kTickS, figures.largest_drift_m});
    }
    std::ranges::sort(responses, {}, &Response::time_s);
    return responses;
  }

  static void ExpectWithin(const std::vector<Response>& responses, double median_s,
                           double longest_s) {
    EXPECT_LE(responses[responses.size() / 2].time_s, median_s);
    EXPECT_LE(responses.back().time_s, longest_s);
    for (const Response& response : responses) EXPECT_LE(response.largest_drift_m, 1e-3);
  }

  // Returns the angle from the heading of the walk, which is 0, to that of the pelvis.
  static double PelvisYaw(const AvatarSimulation& avatar) {
    const Vec3 forward = avatar.pose().rotations[0] * Vec3(0.0f, 0.0f, 1.0f);
    return std::fabs(std::atan2(forward.x, forward.z));
  }

  static WalkRequest WalkAlong(const AvatarSimulation& avatar, double heading_rad) {
    return {.position_m = avatar.base().position_m +
                          DVec3(4.0 * std::sin(heading_rad), 0.0, 4.0 * std::cos(heading_rad)),
            .heading_rad = heading_rad};
  }

  const Library library_ = OpenLibrary("builtin").value();
};

TEST_F(ResponseBuiltin, StopsWithinAStep) {
  const auto responses =
      Respond([](const AvatarSimulation&) { return StandRequest{5.0}; },
              [](const AvatarSimulation&, double speed_m_s) { return speed_m_s < 0.05; });
  ExpectWithin(responses, 0.6, 0.8);
}

TEST_F(ResponseBuiltin, TurnsInAFewSteps) {
  const auto turn = [&](double turn_rad) {
    return Respond(
        [&](const AvatarSimulation& avatar) { return WalkAlong(avatar, turn_rad); },
        [&](const AvatarSimulation& avatar, double) { return PelvisYaw(avatar) > 0.9 * turn_rad; });
  };
  ExpectWithin(turn(M_PI), 2.0, 2.2);
  ExpectWithin(turn(M_PI / 2), 1.2, 1.4);
}

TEST_F(ResponseBuiltin, JumpsSoonAfterTheRequest) {
  const auto responses =
      Respond([](const AvatarSimulation&) { return JumpRequest{0.8}; },
              [](const AvatarSimulation& avatar, double) {
                const Movement* movement = avatar.movement();
                return avatar.started()->kind == MovementKind::kJump && movement != nullptr &&
                       !movement->feet.foot(Foot::kLeft).IsPlanted(avatar.movement_time_s());
              });
  ExpectWithin(responses, 1.2, 1.5);
}

TEST_F(InterruptBuiltin, EndsWalksAndStands) {
  ASSERT_TRUE(avatar_.Enqueue({1, WalkRequest{.position_m = {0.0, 0.0, 5.0}}}).has_value());
  for (int i = 0; i < 90; ++i) avatar_.Advance(kTickS);
  InterruptWith(WalkRequest{.position_m = {1.0, 0.0, 0.0}, .heading_rad = 1.0});
  AdvanceUntil([&] { return avatar_.idle(); });
  EXPECT_NEAR(avatar_.base().position_m.x, 1.0, 0.01);
  EXPECT_NEAR(avatar_.base().position_m.z, 0.0, 0.01);

  ASSERT_TRUE(avatar_.Enqueue({1, StandRequest{100.0}}).has_value());
  avatar_.Advance(kTickS);
  InterruptWith(StepRequest{.length_m = 0.5});
  avatar_.Advance(kTickS);
  EXPECT_EQ(avatar_.started()->request_id, 2u);
}

}  // namespace
}  // namespace stridewire
