#include "offline/inspect/refusals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "offline/inspect/empty_file.h"
#include "stridewire/offline/choreography.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

std::vector<Refusal> RefusalsOf(const std::string& movements) {
  const auto choreography = ParseChoreography("{\"movements\":[" + movements + "]}", "c.json");
  EXPECT_TRUE(choreography) << Describe(choreography.error());
  const SynthesisInput input{.library = *OpenLibrary("builtin"),
                             .start = choreography->start,
                             .requests = choreography->movements,
                             .options = {.terrain = choreography->terrain}};
  const auto synthesis = Synthesize(input);
  EXPECT_TRUE(synthesis) << Describe(synthesis.error());
  return FindRefusals(input, *synthesis);
}

double ValueOf(const Refusal::Values& values, const std::string& name) {
  for (const auto& [value_name, value] : values) {
    if (value_name == name) return value;
  }
  ADD_FAILURE() << "no value " << name;
  return 0.0;
}

TEST(Refusals, RequestsInReachAreNotListed) {
  EXPECT_THAT(RefusalsOf(R"({"step":{"length_m":0.28}}, {"step":{"length_m":0.28}},
                            {"step":{"length_m":0.28}}, {"stand":{"seconds":0.5}},
                            {"step":{"length_m":0.0,"side_m":0.35}},
                            {"step":{"length_m":0.3,"turn_rad":0.4}},
                            {"step":{"length_m":0.3,"height_m":0.2}},
                            {"step":{"at_m":[1,0,3],"heading_rad":0}},
                            {"jump":{"length_m":0.9}},
                            {"walk_to":{"position_m":[3,0,5],"heading_rad":1.6}})")
                  .size(),
              // The footprint at (1, 0, 3) is too far away.
              1u);
}

class TooLongSteps : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Refusals, TooLongSteps, testing::Values("false", "true"));

// The list is the same whether the avatar skips the step or plays the nearest one.
TEST_P(TooLongSteps, AreListedWithTheirResult) {
  const auto refusals = RefusalsOf(
      std::string(R"({"step":{"length_m":0.5}}, {"step":{"length_m":1.5,"allow_nearest":)") +
      GetParam() + "}}");
  ASSERT_THAT(refusals, SizeIs(1));
  const Refusal& refusal = refusals.front();
  EXPECT_EQ(refusal.request_id, 2u);
  EXPECT_EQ(refusal.kind, "step");
  EXPECT_DOUBLE_EQ(ValueOf(refusal.requested, "length_m"), 1.5);
  EXPECT_NEAR(ValueOf(refusal.actual, "length_m"), 0.8, 0.1);
  EXPECT_NEAR(refusal.missed_m, 0.7, 0.1);
  EXPECT_LT(refusal.missed_rad, 0.2);
  EXPECT_THAT(refusal.reason, testing::AnyOf(HasSubstr("1.50 m ahead of the other foot"),
                                             HasSubstr("was skipped: the step is out of reach")));
}

TEST(Refusals, StepsInTheWrongDirectionAreListed) {
  const auto refusals = RefusalsOf(R"({"step":{"length_m":-3,"allow_nearest":true}})");
  ASSERT_THAT(refusals, SizeIs(1));
  EXPECT_THAT(refusals.front().reason, HasSubstr("3.00 m behind the other foot"));
}

TEST(Refusals, TooFarTurnsAreListed) {
  const auto refusals = RefusalsOf(R"({"step":{"length_m":0.3,"turn_rad":3}})");
  ASSERT_THAT(refusals, SizeIs(1));
  EXPECT_GT(refusals.front().missed_rad, kMaxRequestErrorRad);
}

TEST(Refusals, JumpsWalksAndSkippedStepsAreListedInOrder) {
  const auto refusals = RefusalsOf(
      R"({"jump":{"length_m":4}}, {"step":{"at_m":[0,0,30],"heading_rad":0,"exact_only":true}})");
  ASSERT_THAT(refusals, SizeIs(2));
  EXPECT_EQ(refusals[0].kind, "jump");
  EXPECT_LT(ValueOf(refusals[0].actual, "length_m"), 2.0);
  EXPECT_EQ(refusals[1].request_id, 2u);
  EXPECT_THAT(refusals[1].reason, HasSubstr("was skipped: "));
}

TEST(Refusals, WalksThatDoNotArriveAreListed) {
  const auto choreography = ParseChoreography(
      R"({"terrain":{"boxes":[{"min_m":[-9,2],"max_m":[9,3],"height_m":2}]},
          "movements":[{"walk_to":{"position_m":[0,0,5],"heading_rad":0}}]})",
      "c.json");
  ASSERT_TRUE(choreography);
  const SynthesisInput input{.library = *OpenLibrary("builtin"),
                             .start = choreography->start,
                             .requests = choreography->movements,
                             .options = {.terrain = choreography->terrain}};
  const auto synthesis = Synthesize(input);
  ASSERT_TRUE(synthesis);
  const auto refusals = FindRefusals(input, *synthesis);
  ASSERT_THAT(refusals, SizeIs(1));
  EXPECT_EQ(refusals[0].kind, "walk_to");
  EXPECT_GT(refusals[0].missed_m, 2.0);
  EXPECT_THAT(refusals[0].reason, HasSubstr("did not arrive: "));
}

// There is a reason for every file without movements.
TEST(ReasonForNoMovements, IsNeverEmptyForAnEmptyFile) {
  Extraction extraction{.frames = 1, .fps = 30.0};
  extraction.rejected = {{1.0, 2.0, "a short reason"}, {3.0, 7.0, "the main reason"}};
  EXPECT_THAT(ReasonForNoMovements(extraction, true, true), HasSubstr("the main reason"));
  extraction.no_movement_reason = "this is a run";
  EXPECT_EQ(ReasonForNoMovements(extraction, true, true), "this is a run");
  extraction.error = "the capture is unusable";
  EXPECT_EQ(ReasonForNoMovements(extraction, true, true), "the capture is unusable");
}

TEST(ReasonForNoMovements, NamesTheKindThatIsNotSelected) {
  Extraction extraction{.frames = 300, .fps = 30.0, .steps_left = 2, .steps_right = 1};
  EXPECT_THAT(ReasonForNoMovements(extraction, true, false), IsEmpty());
  EXPECT_THAT(ReasonForNoMovements(extraction, false, true), HasSubstr("3 steps but no jump"));
}

}  // namespace
}  // namespace stridewire
