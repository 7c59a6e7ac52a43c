#include "offline/inspect/self_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "offline/builtin/builtin_library.h"
#include "offline/inspect/inspect_json.h"
#include "offline/inspect/leg_survey.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::shared_ptr<const MotionLibrary> Build(const RawLibrary& raw) {
  auto library = LibraryBuilder().Build(raw);
  EXPECT_TRUE(library) << Describe(library.error());
  return *library;
}

RawLibrary Without(const std::vector<MovementKind>& kinds) {
  RawLibrary raw = GenerateBuiltinLibrary();
  std::erase_if(raw.groups, [&](const RawGroup& group) {
    return std::ranges::find(kinds, group.kind) != kinds.end();
  });
  return raw;
}

const CheckResult& Find(const SelfCheck& check, const std::string& name) {
  return *std::ranges::find(check.checks, name, &CheckResult::name);
}

TEST(SelfCheck, BuiltinLibraryPassesEveryCheck) {
  const SelfCheck check = CheckLibrary(*OpenLibrary("builtin"));
  std::vector<std::string> names;
  for (const CheckResult& result : check.checks) {
    SCOPED_TRACE(result.name + ": " + result.text);
    names.push_back(result.name);
    EXPECT_EQ(result.verdict, CheckVerdict::kPassed);
    ASSERT_TRUE(result.measured);
    EXPECT_LE(*result.measured, result.bound);
    EXPECT_TRUE(result.advice.empty());
  }
  EXPECT_THAT(names, ElementsAre("three_steps", "stop", "walk_to", "knees", "soles"));
  EXPECT_TRUE(check.passed());
  EXPECT_EQ(DescribeVerdict(check), "Self-check passed.");
}

TEST(SelfCheck, GivesTheSameResultTwice) {
  const auto library = *OpenLibrary("builtin");
  EXPECT_EQ(SelfCheckToJson(CheckLibrary(library)), SelfCheckToJson(CheckLibrary(library)));
}

TEST(SelfCheck, OneSidedLibraryFailsWithAHintAtMirroring) {
  const SelfCheck check = CheckLibrary(Build(Without({MovementKind::kStepRight})));
  EXPECT_FALSE(check.passed());
  const CheckResult& steps = Find(check, "three_steps");
  EXPECT_EQ(steps.verdict, CheckVerdict::kFailed);
  EXPECT_THAT(steps.advice, HasSubstr("--mirror"));
  EXPECT_FALSE(steps.text.empty());
  EXPECT_THAT(DescribeVerdict(check), HasSubstr("Self-check failed"));
}

TEST(SelfCheck, StepsOfOneFootAreNotPlainSteps) {
  RawLibrary raw = Without({MovementKind::kStepRight});
  std::erase_if(raw.groups, [](const RawGroup& group) {
    return IsStep(group.kind) && group.parameters.size() > 2;
  });
  const CheckResult steps = Find(CheckLibrary(Build(raw)), "three_steps");
  EXPECT_EQ(steps.verdict, CheckVerdict::kFailed) << steps.text;
}

TEST(SelfCheck, LibraryWithoutStepsMeasuresItsJumps) {
  const SelfCheck check =
      CheckLibrary(Build(Without({MovementKind::kStepLeft, MovementKind::kStepRight})));
  for (const char* name : {"three_steps", "stop", "walk_to"}) {
    EXPECT_EQ(Find(check, name).verdict, CheckVerdict::kNotApplicable) << name;
    EXPECT_EQ(Find(check, name).text, "The library has no steps.");
  }
  EXPECT_EQ(Find(check, "knees").verdict, CheckVerdict::kPassed);
  EXPECT_TRUE(Find(check, "soles").measured.has_value());
}

TEST(SelfCheck, JsonContainsEveryCheck) {
  const SelfCheck check = CheckLibrary(Build(Without({MovementKind::kStepRight})));
  const nlohmann::ordered_json json = SelfCheckToJson(check);
  EXPECT_EQ(json["passed"], false);
  ASSERT_EQ(json["checks"].size(), check.checks.size());
  for (std::size_t i = 0; i < check.checks.size(); ++i) {
    EXPECT_EQ(json["checks"][i]["name"], check.checks[i].name);
    EXPECT_EQ(json["checks"][i]["text"], check.checks[i].text);
    EXPECT_EQ(json["checks"][i]["verdict"], CheckVerdictName(check.checks[i].verdict));
  }
}

// Returns one frame: the stand pose with both knees bent by `knee_rad` about the axis that points
// to the left of the figure. Each thigh turns by half of that in the opposite direction.
Synthesis StandWithBentKnees(const MotionLibrary& library, float knee_rad) {
  Pose pose = library.stand_pose();
  const auto turn = [](float angle) {
    return Quat(std::cos(0.5f * angle), std::sin(0.5f * angle), 0.0f, 0.0f);
  };
  for (const Leg& leg : library.skeleton().legs) {
    Quat& hip = pose.rotations[static_cast<std::size_t>(leg.hip)];
    hip = turn(-0.5f * knee_rad) * hip;
    Quat& knee = pose.rotations[static_cast<std::size_t>(leg.knee)];
    knee = turn(knee_rad) * knee;
  }
  Synthesis synthesis;
  synthesis.clip.fps = 30.0;
  synthesis.clip.joint_count = library.skeleton().joint_count();
  synthesis.clip.root_positions_m.push_back(pose.root_position_m);
  synthesis.clip.rotations = pose.rotations;
  return synthesis;
}

TEST(LegSurvey, TellsForwardFromBackwardKnees) {
  const auto library = *OpenLibrary("builtin");
  LegDeviations forward;
  SurveyLegs(*library, StandWithBentKnees(*library, 1.0f), true, forward);
  ASSERT_TRUE(forward.knee_deg);
  EXPECT_LT(*forward.knee_deg, 20.0);
  LegDeviations backward;
  SurveyLegs(*library, StandWithBentKnees(*library, -1.0f), true, backward);
  ASSERT_TRUE(backward.knee_deg);
  EXPECT_GT(*backward.knee_deg, 160.0);
}

TEST(LegSurvey, MeasuresSolesAboveAndBelowTheGround) {
  const auto library = *OpenLibrary("builtin");
  Synthesis synthesis = StandWithBentKnees(*library, 0.0f);
  MovementRecord movement;
  movement.plants = {{.foot = Foot::kLeft, .from_s = 0.0, .to_s = 1.0}};
  synthesis.movements = {movement};
  synthesis.clip.root_positions_m.front().y += 0.03f;
  for (const bool has_stand : {true, false}) {
    LegDeviations above;
    SurveyLegs(*library, synthesis, has_stand, above);
    EXPECT_NEAR(above.hover_m, 0.03, 0.002);
    EXPECT_EQ(above.sink_m, 0.0);
  }
  synthesis.clip.root_positions_m.front().y -= 0.08f;
  LegDeviations below;
  SurveyLegs(*library, synthesis, true, below);
  EXPECT_NEAR(below.sink_m, 0.05, 0.002);
  EXPECT_EQ(below.hover_m, 0.0);
}

TEST(LegSurvey, FeetThatDoNotStandMayBeInTheAir) {
  const auto library = *OpenLibrary("builtin");
  Synthesis synthesis = StandWithBentKnees(*library, 0.0f);
  synthesis.clip.root_positions_m.front().y += 0.03f;
  LegDeviations deviations;
  SurveyLegs(*library, synthesis, true, deviations);
  EXPECT_EQ(deviations.hover_m, 0.0);
}

TEST(LegSurvey, StraightLegsHaveNoDirection) {
  const auto library = *OpenLibrary("builtin");
  LegDeviations deviations;
  SurveyLegs(*library, StandWithBentKnees(*library, 0.0f), true, deviations);
  EXPECT_FALSE(deviations.knee_deg);
  EXPECT_EQ(deviations.feet, 2);
  EXPECT_LT(deviations.sink_m, 0.002);
}

}  // namespace
}  // namespace stridewire
