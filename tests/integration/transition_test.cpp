// Transitions between movements: the table in a library, and the steps that an avatar inserts
// because of it.

#include "runtime/library/transition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "captured_library.h"
#include "counted_memory.h"
#include "motion_library_generated.h"
#include "random.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/library_file.h"
#include "runtime/plan/transition_path.h"
#include "runtime/skeleton/foot_vector.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/synthesis.h"
#include "test_library.h"
#include "velocity_steps.h"

namespace stridewire {
namespace {

// Groups of the test library, followed by the stand.
constexpr std::size_t kLeft = 0;
constexpr std::size_t kRight = 1;
constexpr std::size_t kJump = 2;
constexpr std::size_t kStand = 3;

float DistanceM(const MotionLibrary& library, std::size_t from, std::size_t to) {
  return library.FindTransition(from, to)->distance_m;
}

// The test library with only those steps whose length satisfies `is_kept`, and with its jumps.
template <typename IsKept>
std::shared_ptr<const MotionLibrary> ToyOf(IsKept is_kept) {
  RawLibrary raw = MakeTestRawLibrary();
  for (RawGroup& group : raw.groups) {
    if (!IsStep(group.kind)) continue;
    std::erase_if(group.examples, [&](const RawExample& step) {
      return !is_kept(-step.parameters[0], step.parameters[1]);
    });
  }
  return LibraryBuilder().Build(raw).value();
}

TEST(Transitions, ClosingStepsFitJumpsAndTheStand) {
  const auto library = MakeTestLibrary();
  ASSERT_EQ(library->transitions().size(), 16u);
  for (const std::size_t step : {kLeft, kRight}) {
    EXPECT_LT(DistanceM(*library, step, kJump), 0.01f);
    EXPECT_LT(DistanceM(*library, kJump, step), 0.01f);
    EXPECT_LT(DistanceM(*library, step, kStand), 0.01f);
    EXPECT_LT(DistanceM(*library, kStand, step), 0.01f);
    const Transition& closing = *library->FindTransition(step, kStand);
    EXPECT_NEAR(library->group(static_cast<int>(step)).site(closing.end_example)[1], 0.0, 1e-9);
    EXPECT_EQ(closing.start_example, -1);
  }
}

// Legs of 0.9 m at angles that put the feet 0.4 m apart. The expected distances of hips, knees and
// feet follow from geometry. The steps of the test library begin and end at rest.
TEST(Transitions, DistanceMeasuresJointPositions) {
  const auto library = ToyOf([](double l0, double l1) { return l0 >= 0.2 && l1 == 0.4; });
  const double lower_m = 0.9 - std::sqrt(0.81 - 0.04);
  const double hips = 3.0 * lower_m * lower_m;
  const double knees = 2.0 * (0.01 + 0.25 * lower_m * lower_m);
  const double feet = 2.0 * 0.04;
  const double expected_m = std::sqrt((hips + knees + feet) / 7.0);
  EXPECT_NEAR(DistanceM(*library, kLeft, kJump), expected_m, 0.01);
  EXPECT_NEAR(DistanceM(*library, kRight, kStand), expected_m, 0.01);
  // With the left foot ahead, the next step is a right step, not a left one.
  EXPECT_LT(DistanceM(*library, kLeft, kRight), 0.02f);
  EXPECT_GT(DistanceM(*library, kLeft, kLeft), 0.17f);
}

// A jump that still moves at its end. The speed counts with 0.1 s.
TEST(Transitions, DistanceIncludesVelocities) {
  RawLibrary raw = MakeTestRawLibrary();
  for (RawExample& jump : raw.groups[kJump].examples) {
    for (int f = 0; f < jump.clip.frame_count(); ++f) {
      jump.clip.root_positions_m[static_cast<std::size_t>(f)].z =
          2.0f * static_cast<float>(f / jump.clip.fps);
    }
  }
  const auto library = LibraryBuilder().Build(raw).value();
  EXPECT_NEAR(DistanceM(*library, kJump, kStand), 0.2, 0.001);
  EXPECT_NEAR(DistanceM(*library, kStand, kJump), 0.2, 0.001);
  EXPECT_NEAR(DistanceM(*library, kJump, kJump), 0.0, 0.001);
}

// The library with changed bytes and a header that matches them.
template <typename Change>
Expected<std::shared_ptr<const MotionLibrary>> Changed(const MotionLibrary& library,
                                                       Change change) {
  std::vector<std::byte> bytes(library.bytes().begin(), library.bytes().end());
  const std::span payload = std::span(bytes).subspan(kLibraryHeaderBytes);
  change(reinterpret_cast<std::uint8_t*>(payload.data()));
  const auto header = MakeLibraryHeader(payload);
  std::ranges::copy(header, bytes.begin());
  return MotionLibrary::FromBytes(bytes);
}

// The library in the format before transitions were added.
Expected<std::shared_ptr<const MotionLibrary>> Older(const MotionLibrary& library) {
  return Changed(library, [](std::uint8_t* payload) {
    const auto* root = fb::GetMotionLibrary(payload);
    const auto* table = reinterpret_cast<const std::uint8_t*>(root);
    const std::uint8_t* fields = table - flatbuffers::ReadScalar<flatbuffers::soffset_t>(table);
    std::memset(payload + (fields - payload) + fb::MotionLibrary::VT_TRANSITIONS, 0, 2);
  });
}

TEST(Transitions, AreOptionalInALibrary) {
  const auto older = Older(*MakeTestLibrary());
  ASSERT_TRUE(older.has_value()) << Describe(older.error());
  EXPECT_TRUE((*older)->transitions().empty());
  EXPECT_EQ((*older)->FindTransition(kLeft, kJump), nullptr);
  EXPECT_EQ((*older)->groups().size(), 3u);
}

TEST(Transitions, RejectsAnInvalidTable) {
  const auto with = [](std::size_t place, fb::Transition transition) {
    const auto library = Changed(*MakeTestLibrary(), [&](std::uint8_t* payload) {
      const auto* all = fb::GetMotionLibrary(payload)->transitions()->Data();
      std::memcpy(payload + (all - payload) + place * sizeof transition, &transition,
                  sizeof transition);
    });
    return library ? "none" : std::string(library.error().text);
  };
  const std::string refused = "a transition refers to an example that does not exist";
  const std::size_t jump_to_stand = kJump * 4 + kStand;
  EXPECT_EQ(with(jump_to_stand, {0.1f, 3, -1}), "none");
  EXPECT_EQ(with(jump_to_stand, {0.1f, 4, -1}), refused);
  EXPECT_EQ(with(jump_to_stand, {0.1f, -1, -1}), refused);
  EXPECT_EQ(with(jump_to_stand, {0.1f, 3, 0}), refused);
  EXPECT_EQ(with(jump_to_stand, {-0.1f, 3, -1}), refused);
  EXPECT_EQ(with(jump_to_stand, {std::numeric_limits<float>::quiet_NaN(), 3, -1}), refused);
  EXPECT_EQ(with(jump_to_stand, {std::numeric_limits<float>::infinity(), 3, -1}), refused);
}

// Describes what an avatar does with a sequence of requests until it is idle, for example "left
// jump". Inserted steps have the prefix "+", rejected requests the prefix "-" and the reason.
std::string Does(std::shared_ptr<const MotionLibrary> library,
                 const std::vector<decltype(MovementRequest::movement)>& movements) {
  AvatarSimulation avatar(std::move(library), BaseFrame{});
  std::uint64_t id = 0;
  for (const auto& movement : movements) {
    const Status status = avatar.Enqueue({++id, movement});
    EXPECT_TRUE(status.has_value()) << Describe(status.error());
  }
  std::string text;
  for (int tick = 0; tick < 3600 && !avatar.idle(); ++tick) {
    avatar.Advance(1.0 / 60.0);
    for (const AvatarEvent& event : avatar.events()) {
      if (event.type == AvatarEventType::kStarted) {
        text += (text.empty() ? "" : " ") + std::string(event.request_id == 0 ? "+" : "") +
                std::string(MovementKindName(event.kind));
      } else if (event.type == AvatarEventType::kRejected) {
        EXPECT_EQ(event.code, ErrorCode::kUnsupported);
        text += " -(" + std::string(event.reason) + ")";
      }
    }
  }
  EXPECT_TRUE(avatar.idle());
  return text;
}

StepRequest Step(Foot foot, double length_m) { return {.foot = foot, .length_m = length_m}; }

TEST(TransitionPath, IsAsShortAsPossible) {
  const auto library = OpenLibrary("builtin").value();
  const StepRequest left = Step(Foot::kLeft, 0.6);
  const StepRequest right = Step(Foot::kRight, 0.6);
  const JumpRequest jump{.length_m = 0.9};
  const StandRequest stand{0.2};
  EXPECT_EQ(Does(library, {left, right}), "step_left step_right +step_left");
  EXPECT_EQ(Does(library, {left, jump}), "step_left +step_right jump");
  EXPECT_EQ(Does(library, {left, left}), "step_left +step_right step_left +step_right");
  EXPECT_EQ(Does(library, {left, stand, left}),
            "step_left +step_right stand step_left +step_right");
  EXPECT_EQ(Does(library, {jump, right, jump}), "jump step_right +step_left jump");
  EXPECT_EQ(Does(library, {jump, jump, stand, jump}), "jump jump stand jump");
  // Feet that are together, or a step that brings them together, need no inserted step.
  EXPECT_EQ(Does(library, {Step(Foot::kLeft, 0.0), left}), "step_left step_left +step_right");
  EXPECT_EQ(Does(library, {Step(Foot::kLeft, 0.3), Step(Foot::kLeft, 0.0), jump}),
            "step_left step_left jump");
}

TEST(TransitionPath, KeepsTheRequestedFoot) {
  const auto library = OpenLibrary("builtin").value();
  const std::vector<MovementRequest> requests{{1, Step(Foot::kLeft, 0.6)},
                                              {2, Step(Foot::kLeft, 0.5)}};
  const Synthesis synthesis = Synthesize({.library = library, .requests = requests}).value();
  ASSERT_EQ(synthesis.movements.size(), 4u);
  EXPECT_EQ(synthesis.movements[1].request_id, 0u);
  EXPECT_EQ(synthesis.movements[2].request_id, 2u);
  EXPECT_LT(synthesis.movements[2].landing_error_m, 0.001);
}

TEST(TransitionPath, ReportsThatFeetCannotComeTogether) {
  const auto strides = ToyOf([](double l0, double l1) { return l0 != 0.2 && l1 >= 0.4; });
  ASSERT_GT(DistanceM(*strides, kLeft, kJump), 0.1f);
  const StepRequest left = Step(Foot::kLeft, 0.5);
  const JumpRequest jump{.length_m = 0.6};
  EXPECT_EQ(Does(strides, {jump, left}), "jump step_left +step_right");
  EXPECT_EQ(Does(strides, {left, jump, StepRequest{.length_m = 0.5}}),
            "step_left -(this library has no transition path from step_left to jump) step_right "
            "+step_left");
  EXPECT_EQ(Does(strides, {left, left}), "step_left +step_right step_left +step_right");
  const std::vector<MovementRequest> requests{{1, left}, {2, jump}};
  const auto synthesis = Synthesize({.library = strides, .requests = requests});
  ASSERT_FALSE(synthesis.has_value());
  EXPECT_EQ(Describe(synthesis.error()),
            "movements[1]: this library has no transition path from step_left to jump");
}

// A standing avatar whose feet are apart may have no path either (found by LibraryMutation).
TEST(TransitionPath, HasAReasonForEveryKindOfMovement) {
  using enum MovementKind;
  for (const MovementKind to : {kStepLeft, kStepRight, kJump}) {
    const std::string end = " to " + std::string(MovementKindName(to));
    for (const MovementKind from : {kStepLeft, kStepRight, kJump}) {
      EXPECT_EQ(NoPathReason(from, to), "this library has no transition path from " +
                                            std::string(MovementKindName(from)) + end);
    }
    EXPECT_EQ(NoPathReason(kStand, to), "this library has no transition path from a stand" + end);
  }
}

TEST(TransitionPath, ReportsThatTheLibraryHasOneFootOnly) {
  RawLibrary raw = MakeTestRawLibrary();
  raw.groups.erase(raw.groups.begin() + kRight);
  const auto one_foot = std::shared_ptr(LibraryBuilder().Build(raw).value());
  EXPECT_EQ(
      Does(one_foot, {StepRequest{.length_m = 0.5}, StepRequest{.length_m = 0.5}}),
      "step_left -(this library has no transition path from step_left to step_left) +step_left");
  // The step that brings the feet together is not a new request.
  EXPECT_EQ(Does(one_foot, {StepRequest{.length_m = 0.2}, StepRequest{.length_m = 0.2}}),
            "step_left step_left +step_left");
}

// A jump that still moves at its end: the feet are together, but according to the table no step
// starts that fast.
TEST(TransitionPath, RejectsDistantTransitions) {
  RawLibrary raw = MakeTestRawLibrary();
  for (RawExample& jump : raw.groups[kJump].examples) {
    for (int f = 0; f < jump.clip.frame_count(); ++f) {
      const double s = f / (jump.clip.frame_count() - 1.0);
      jump.clip.root_positions_m[static_cast<std::size_t>(f)].z = static_cast<float>(2.0 * s * s);
    }
  }
  const auto library = std::shared_ptr(LibraryBuilder().Build(raw).value());
  ASSERT_GT(DistanceM(*library, kJump, kLeft), 0.3f);
  const StepRequest left = Step(Foot::kLeft, 0.4);
  EXPECT_EQ(Does(library, {JumpRequest{.length_m = 0.6}, left}),
            "jump -(this library has no transition path from jump to step_left)");
  // After a stand, every movement is possible.
  EXPECT_EQ(Does(library, {JumpRequest{.length_m = 0.6}, StandRequest{0.1}, left}),
            "jump stand step_left +step_right");
}

// Two groups of left steps. The one that suits long steps begins either with the feet together or
// with the hips 0.4 m too high, so that its steps cannot follow a stride. Those of the other group
// can, although they are shorter.
TEST(TransitionPath, UsesAnotherGroupIfTheBestOneCannotFollow) {
  RawLibrary raw = MakeTestRawLibrary();
  RawGroup distant = raw.groups[kLeft];
  for (RawExample& step : distant.examples) {
    const float lift_m = step.parameters[0] == 0.0 ? 0.1f : 0.4f;
    for (Vec3& root_m : step.clip.root_positions_m) root_m.y += lift_m;
  }
  const auto keep = [&](std::size_t group, auto is_kept) {
    std::erase_if(raw.groups[group].examples, [&](const RawExample& step) {
      return !is_kept(-step.parameters[0], step.parameters[1]);
    });
  };
  keep(kLeft, [](double l0, double l1) { return l0 >= 0.4 && (l1 == 0.2 || l1 == 0.4); });
  keep(kRight, [](double, double l1) { return l1 >= 0.4; });
  raw.groups.push_back(std::move(distant));
  const auto library = std::shared_ptr(LibraryBuilder().Build(raw).value());
  constexpr std::size_t kDistant = 3;
  ASSERT_GT(DistanceM(*library, kRight, kDistant), 0.15f);
  ASSERT_LT(DistanceM(*library, kRight, kLeft), 0.05f);

  StepRequest step{.length_m = 0.6};
  step.allow_nearest = true;
  AvatarSimulation avatar(library, BaseFrame{});
  for (std::uint64_t id = 1; id <= 3; ++id) ASSERT_TRUE(avatar.Enqueue({id, step}).has_value());
  std::vector<int> groups;
  for (int tick = 0; tick < 600 && groups.size() < 3; ++tick) {
    avatar.Advance(1.0 / 60.0);
    for (const AvatarEvent& event : avatar.events()) {
      ASSERT_NE(event.type, AvatarEventType::kRejected) << event.reason;
      if (event.type == AvatarEventType::kStarted) groups.push_back(event.group);
    }
  }
  EXPECT_EQ(groups, (std::vector<int>{kDistant, kRight, kLeft}));
}

// Without a table, only the positions of the feet matter.
// Captured steps in a crouch, and generated upright steps with the same parameters.
TEST(TransitionPath, WalksPreferGroupsThatFitThePreviousMovement) {
  RawLibrary raw = MakeTestRawLibrary();
  std::vector<RawGroup> upright;
  for (RawGroup& group : raw.groups) {
    if (!IsStep(group.kind)) continue;
    RawGroup& generated = upright.emplace_back(group);
    generated.is_completed = true;
    for (RawExample& step : generated.examples) step.source = "completed step";
    for (RawExample& step : group.examples) {
      for (int f = 0; f < step.clip.frame_count(); ++f) {
        step.clip.frame(f).root_position_m.y -= 0.4f;
      }
    }
  }
  const std::size_t captured_right = kRight;
  const std::size_t generated_right = raw.groups.size() + 1;
  raw.groups.insert(raw.groups.end(), upright.begin(), upright.end());
  const auto library = LibraryBuilder().Build(raw).value();
  ASSERT_TRUE(library->groups()[generated_right].is_completed);

  // The right foot is behind, and a walk continues straight ahead.
  const DVec3 left_m(0.1, 0.0, 0.4);
  const FootState feet{left_m - DVec3(-0.1, 0.0, 0.0)};
  const auto group_for = [&](const FootprintOrigin& origin) {
    const Footprint print{DVec3(-0.1, 0.0, 0.8), 0.0};
    const auto plan = PlanFootprint(*library, Foot::kRight, print, left_m, 0.0, feet, origin);
    return static_cast<std::size_t>(plan.value().group);
  };
  const std::size_t captured_left = kLeft;
  const std::size_t generated_left = generated_right - 1;
  EXPECT_EQ(group_for({.is_walk = true, .after = captured_left}), captured_right);
  EXPECT_EQ(group_for({.is_walk = true, .after = generated_left}), generated_right);
  EXPECT_EQ(group_for({}), captured_right);
}

TEST(TransitionPath, UsesFootPositionsWithoutATable) {
  const auto strides = ToyOf([](double l0, double l1) { return l0 != 0.2 && l1 >= 0.4; });
  const auto older = Older(*strides);
  ASSERT_TRUE(older.has_value());
  const StepRequest left = Step(Foot::kLeft, 0.5);
  EXPECT_EQ(Does(*older, {left, JumpRequest{.length_m = 0.6}}),
            "step_left -(this library has no transition path from step_left to jump) +step_right");
  EXPECT_EQ(Does(Older(*MakeTestLibrary()).value(), {left, left, JumpRequest{.length_m = 0.6}}),
            "step_left +step_right step_left +step_right jump");
}

TEST(TransitionPath, DoesNotAllocate) {
  const auto strides = ToyOf([](double l0, double l1) { return l0 != 0.2 && l1 >= 0.4; });
  for (const auto& library : {OpenLibrary("builtin").value(), strides}) {
    AvatarSimulation avatar(library, BaseFrame{});
    avatar.Advance(1.0 / 60.0);  // The first call allocates scratch memory.
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE(avatar.Enqueue({1, Step(Foot::kLeft, 0.6)}).has_value());
      ASSERT_TRUE(avatar.Enqueue({2, Step(Foot::kLeft, 0.5)}).has_value());
      ASSERT_TRUE(avatar.Enqueue({3, JumpRequest{.length_m = 0.6}}).has_value());
    }
    const std::size_t before = counted_memory::LiveBytes();
    counted_memory::ResetPeak();
    int inserted = 0;
    for (int tick = 0; tick < 3600 && !avatar.idle(); ++tick) {
      avatar.Advance(1.0 / 60.0);
      for (const AvatarEvent& event : avatar.events()) {
        inserted += event.type == AvatarEventType::kStarted && event.request_id == 0;
      }
    }
    EXPECT_GE(inserted, 3);
    EXPECT_LE(counted_memory::PeakBytes(), before);
  }
}

TEST(TransitionPath, RejectsMissingKindsImmediately) {
  RawLibrary raw = MakeTestRawLibrary();
  raw.groups.pop_back();
  const auto no_jumps = std::shared_ptr(LibraryBuilder().Build(raw).value());
  AvatarSimulation avatar(no_jumps, BaseFrame{});
  const Status status = avatar.Enqueue({1, JumpRequest{.length_m = 0.6}});
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(status.error().text, std::string("the library has no jump"));
}

struct Subject {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
};
void PrintTo(const Subject& subject, std::ostream* out) { *out << subject.name; }

class TransitionSmoothness : public testing::TestWithParam<Subject> {};
INSTANTIATE_TEST_SUITE_P(Libraries, TransitionSmoothness,
                         testing::Values(Subject{"Builtin", {}}, Subject{"Subject16", {"16"}},
                                         Subject{"Debian", {kDebianTakes}}),
                         [](const auto& subject) { return subject.param.name; });

constexpr int kKinds = 4;  // Number of MovementKind values; the stand is last.
constexpr double kFramesPerS = 60.0;

// Steps, jumps and stands in any order. Between two movements, no joint may change its velocity by
// more than 1.5 times the largest change inside the examples of both kinds. A stand has no
// examples.
TEST_P(TransitionSmoothness, IsThatOfTheMovementsThemselves) {
  STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
  const auto library = LibraryOf(GetParam().subjects);
  std::array<double, kKinds> inside{};
  for (int kind = 0; kind + 1 < kKinds; ++kind) {
    inside[static_cast<std::size_t>(kind)] =
        LargestStepOfExamples(*library, kFramesPerS, static_cast<MovementKind>(kind)).joint_rad_s;
  }
  const FootState stand{FootVector(library->skeleton(), library->stand_pose(), Foot::kLeft, 0.0)};
  const unsigned seed = 20261122;
  std::array<std::array<double, kKinds>, kKinds> across{};
  std::array<std::array<int, kKinds>, kKinds> counts{};
  int inserted = 0;
  for (unsigned i = 0; i < 12; ++i) {
    Random random(seed + i);
    AvatarSimulation avatar(library, BaseFrame{});
    VelocitySteps steps(library->skeleton(), kFramesPerS);
    std::size_t from = 3;
    std::size_t to = 3;
    double since_s = 0.0;
    std::uint64_t id = 0;
    while (id < 40 || !avatar.idle()) {
      if (avatar.queue_size() == 0 && id < 40) {
        MovementRequest request{++id, StandRequest{0.3}};
        const double what = random.Draw(0.0, 1.0);
        if (what < 0.55) {
          StepRequest step{.length_m = random.Draw(0.0, 0.7), .allow_nearest = true};
          if (random.Draw(0.0, 1.0) < 0.4) step.foot = what < 0.3 ? Foot::kLeft : Foot::kRight;
          request.movement = step;
        } else if (what < 0.8) {
          request.movement = JumpRequest{.length_m = random.Draw(0.5, 1.4), .allow_nearest = true};
        }
        ASSERT_TRUE(avatar.Enqueue(request).has_value());
      }
      avatar.Advance(1.0 / kFramesPerS);
      since_s += 1.0 / kFramesPerS;
      for (const AvatarEvent& event : avatar.events()) {
        ASSERT_NE(event.type, AvatarEventType::kRejected) << event.reason << ", seed " << seed + i;
        const bool is_start = event.type == AvatarEventType::kStarted;
        if (!is_start && event.type != AvatarEventType::kIdle) continue;
        from = std::exchange(to, is_start ? static_cast<std::size_t>(event.kind) : 3);
        since_s = 0.0;
        ++counts[from][to];
        if (!is_start || event.kind == MovementKind::kStand) continue;
        // Steps are inserted only if the feet need them, and a jump waits only as long as
        // necessary.
        const FootState feet{
            FootVector(library->skeleton(), avatar.pose(), Foot::kLeft, avatar.base().heading_rad)};
        if (event.request_id == 0) {
          ++inserted;
          EXPECT_TRUE(AreFeetApart(feet, stand)) << "seed " << seed + i;
        } else if (event.kind == MovementKind::kJump) {
          EXPECT_NEAR(feet.left_from_right_m.z, stand.left_from_right_m.z, 0.25);
        }
      }
      const double step = steps.Add(avatar.pose()).joint_rad_s;
      if (since_s < kEaseOutS) across[from][to] = std::max(across[from][to], step);
    }
  }
  for (std::size_t a = 0; a < kKinds; ++a) {
    for (std::size_t b = 0; b < kKinds; ++b) {
      if (counts[a][b] == 0 || (a == 3 && b == 3)) continue;
      const double ratio = across[a][b] / std::max(inside[a], inside[b]);
      std::printf("%s: %-10s to %-10s %3d times, %5.2f rad/s per frame, %.2f of the examples'\n",
                  GetParam().name,
                  std::string(MovementKindName(static_cast<MovementKind>(a))).c_str(),
                  std::string(MovementKindName(static_cast<MovementKind>(b))).c_str(), counts[a][b],
                  across[a][b], ratio);
      EXPECT_LE(ratio, 1.5);
    }
  }
  std::printf("%s: seed %u, %d steps inserted\n", GetParam().name, seed, inserted);
  for (const auto& [a, b] : {std::pair(0, 2), {2, 1}, {3, 0}, {3, 2}, {1, 3}, {2, 3}}) {
    EXPECT_GT(counts[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)], 5);
  }
}

}  // namespace
}  // namespace stridewire
