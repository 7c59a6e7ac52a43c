// How movements go on where others ended: the table a library has of it.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "library_file.h"
#include "motion_library_generated.h"
#include "stridewire/offline/library_builder.h"
#include "toy_library.h"

namespace stridewire {
namespace {

// Groups of the toy library, and the stand behind them.
constexpr std::size_t kLeft = 0;
constexpr std::size_t kRight = 1;
constexpr std::size_t kJump = 2;
constexpr std::size_t kStand = 3;

float DistanceM(const MotionLibrary& library, std::size_t from, std::size_t to) {
  return library.FindTransition(from, to)->distance_m;
}

// The toy library of steps as long as `is_kept` likes them, and its jumps.
template <typename IsKept>
std::shared_ptr<const MotionLibrary> ToyOf(IsKept is_kept) {
  RawLibrary raw = MakeToyRawLibrary();
  for (RawGroup& group : raw.groups) {
    if (!IsStep(group.kind)) continue;
    std::erase_if(group.examples, [&](const RawExample& step) {
      return !is_kept(-step.parameters[0], step.parameters[1]);
    });
  }
  return LibraryBuilder().Build(raw).value();
}

TEST(Transitions, StepsThatCloseMeetJumpsAndTheStand) {
  const auto library = MakeToyLibrary();
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

// Legs of 0.9 m at angles that put feet 0.4 m apart: hips come down and knees and feet apart, as far as geometry
// says. The toy's steps begin and end at rest.
TEST(Transitions, DistanceIsHowFarJointsAreApart) {
  const auto library = ToyOf([](double l0, double l1) { return l0 >= 0.2 && l1 == 0.4; });
  const double lower_m = 0.9 - std::sqrt(0.81 - 0.04);
  const double hips = 3.0 * lower_m * lower_m;
  const double knees = 2.0 * (0.01 + 0.25 * lower_m * lower_m);
  const double feet = 2.0 * 0.04;
  const double expected_m = std::sqrt((hips + knees + feet) / 7.0);
  EXPECT_NEAR(DistanceM(*library, kLeft, kJump), expected_m, 0.01);
  EXPECT_NEAR(DistanceM(*library, kRight, kStand), expected_m, 0.01);
  // The left foot ahead is where a right step begins, not a left one.
  EXPECT_LT(DistanceM(*library, kLeft, kRight), 0.02f);
  EXPECT_GT(DistanceM(*library, kLeft, kLeft), 0.17f);
}

// A jump that flies on at its end: what has to stop counts with 0.1 s of its speed.
TEST(Transitions, VelocityCounts) {
  RawLibrary raw = MakeToyRawLibrary();
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

// The same library with its bytes changed and a header that fits them.
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

TEST(Transitions, ALibraryFromBeforeThereWereAnyIsRead) {
  const auto older = Changed(*MakeToyLibrary(), [](std::uint8_t* payload) {
    const auto* root = fb::GetMotionLibrary(payload);
    const auto* table = reinterpret_cast<const std::uint8_t*>(root);
    const std::uint8_t* fields = table - flatbuffers::ReadScalar<flatbuffers::soffset_t>(table);
    std::memset(payload + (fields - payload) + fb::MotionLibrary::VT_TRANSITIONS, 0, 2);
  });
  ASSERT_TRUE(older.has_value()) << Describe(older.error());
  EXPECT_TRUE((*older)->transitions().empty());
  EXPECT_EQ((*older)->FindTransition(kLeft, kJump), nullptr);
  EXPECT_EQ((*older)->groups().size(), 3u);
}

TEST(Transitions, ATableThatMakesNoSenseIsRefused) {
  const auto with = [](std::size_t place, fb::Transition transition) {
    const auto library = Changed(*MakeToyLibrary(), [&](std::uint8_t* payload) {
      const auto* all = fb::GetMotionLibrary(payload)->transitions()->Data();
      std::memcpy(payload + (all - payload) + place * sizeof transition, &transition,
                  sizeof transition);
    });
    return library ? "none" : std::string(library.error().text);
  };
  const std::string refused = "a transition is not between two examples";
  const std::size_t jump_to_stand = kJump * 4 + kStand;
  EXPECT_EQ(with(jump_to_stand, {0.1f, 3, -1}), "none");
  EXPECT_EQ(with(jump_to_stand, {0.1f, 4, -1}), refused);
  EXPECT_EQ(with(jump_to_stand, {0.1f, -1, -1}), refused);
  EXPECT_EQ(with(jump_to_stand, {0.1f, 3, 0}), refused);
  EXPECT_EQ(with(jump_to_stand, {-0.1f, 3, -1}), refused);
  EXPECT_EQ(with(jump_to_stand, {std::numeric_limits<float>::quiet_NaN(), 3, -1}), refused);
  EXPECT_EQ(with(jump_to_stand, {std::numeric_limits<float>::infinity(), 3, -1}), refused);
}

}  // namespace
}  // namespace stridewire
