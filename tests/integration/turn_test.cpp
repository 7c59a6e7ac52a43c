// Turns on the spot.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "captured_library.h"
#include "offline/complete/complete_library.h"
#include "stridewire/offline/synthesis.h"

namespace stridewire {
namespace {

class TurnOnTheSpot : public testing::TestWithParam<const char*> {};

std::shared_ptr<const MotionLibrary> LibraryOf(const std::string& subject) {
  if (subject.empty()) return OpenLibrary("builtin").value();
  RawLibrary raw = AssembleTakes(TakesOf({subject}), {.mirror = true});
  EXPECT_EQ(CompleteLibrary(raw).failure, "");
  return LibraryBuilder::Selecting().Build(raw).value();
}

// A foot that stands while the body turns over it must move next. Otherwise, its leg would be
// twisted further with each step.
TEST_P(TurnOnTheSpot, FeetAlternate) {
  const std::string subject = GetParam();
  if (!subject.empty()) STRIDEWIRE_SKIP_WITHOUT_TAKES({subject});
  std::vector<MovementRequest> requests(
      6, {1, StepRequest{.length_m = 0.0, .turn_rad = 0.6, .allow_nearest = true}});
  const auto turns = Synthesize({.library = LibraryOf(subject), .requests = requests, .fps = 60.0});
  ASSERT_TRUE(turns.has_value()) << Describe(turns.error());
  MovementKind last = MovementKind::kStand;
  int steps = 0;
  for (const auto& movement : turns->movements) {
    if (!IsStep(movement.kind)) continue;
    EXPECT_NE(movement.kind, last) << "step " << steps;
    last = movement.kind;
    ++steps;
  }
  EXPECT_GE(steps, 6);
}

INSTANTIATE_TEST_SUITE_P(Libraries, TurnOnTheSpot, testing::Values("", "16", kDebianTakes));

}  // namespace
}  // namespace stridewire
