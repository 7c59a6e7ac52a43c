// Builds a library from every file of the external folder "cases" with the program, and compares
// the result with what the README of that folder expects.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "corpus/bvh_positions.h"
#include "scratch_folder.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/runtime/pose.h"
#include "tool_build.h"

namespace stridewire::test {
namespace {

using nlohmann::json;
using testing::AnyOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr double kKneeNoiseM = 0.002;  // Knees of a straight leg may appear this far backward.

std::string CaseFile(const std::string& name) {
  return (std::filesystem::path(STRIDEWIRE_CASES_DIR) / name).string();
}

class Cases : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::is_directory(STRIDEWIRE_CASES_DIR)) {
      GTEST_SKIP() << "no cases in " << STRIDEWIRE_CASES_DIR;
    }
  }

  [[nodiscard]] ToolBuild Build(const std::string& name,
                                const std::vector<std::string>& options = {}) const {
    return BuildWithTool(folder_, CaseFile(name), options);
  }

  // Expects three steps of each foot. Returns the BVH of four steps synthesized from the library.
  [[nodiscard]] std::string ExpectSixSteps(const ToolBuild& build) const {
    EXPECT_EQ(build.exit_code, 0) << build.err;
    EXPECT_THAT(build.Steps(), ElementsAre(3, 3)) << build.Sentences();
    if (build.exit_code != 0) return {};
    const ToolSynthesis synthesis =
        SynthesizeWithTool(folder_, build.library, CaseFile("c_four_steps.json"));
    EXPECT_EQ(synthesis.exit_code, 0) << synthesis.err;
    EXPECT_LT(LargestBackwardKnee(synthesis.bvh), kKneeNoiseM);
    return synthesis.bvh;
  }

  // Expects the same motion as from the base case.
  void ExpectSame(const std::string& name) const {
    const std::string base = ExpectSixSteps(Build("m00_base.bvh"));
    const std::string bvh = ExpectSixSteps(Build(name));
    ASSERT_FALSE(base.empty() || bvh.empty());
    EXPECT_LT(LargestJointDistance(base, bvh), kSameMotionM);
  }

  // Expects that nothing is built, and that the report has a reason.
  static void ExpectRefused(const ToolBuild& build) {
    EXPECT_EQ(build.exit_code, 2);
    EXPECT_FALSE(build.report.is_null()) << "no report; stderr: " << build.err;
    EXPECT_FALSE(std::filesystem::exists(build.library));
    EXPECT_THAT(build.Sentences(), Not(IsEmpty()));
  }

  const ScratchFolder folder_;
};

TEST_F(Cases, BaseHasSixSteps) { EXPECT_FALSE(ExpectSixSteps(Build("m00_base.bvh")).empty()); }

TEST_F(Cases, StaticRootGivesTheSameMotion) { ExpectSame("m01_root_static.bvh"); }

TEST_F(Cases, LegFramesTurnedAboutZGiveTheSameMotion) { ExpectSame("m04_knee_z180.bvh"); }

TEST_F(Cases, LegFramesTurnedAboutYGiveTheSameMotion) { ExpectSame("m06_knee_y90.bvh"); }

TEST_F(Cases, StepsOntoAKerbAreCounted) { (void)ExpectSixSteps(Build("m08_kerb_8cm.bvh")); }

TEST_F(Cases, StepsAfterALowTPoseAreCounted) {
  (void)ExpectSixSteps(Build("m10_tpose_30_frames_7cm_low.bvh"));
}

TEST_F(Cases, WalkInPlaceIsRefused) {
  const ToolBuild build = Build("m11_in_place.bvh");
  ExpectRefused(build);
  EXPECT_THAT(build.Sentences(), HasSubstr("walks on the spot"));
  EXPECT_THAT(build.Sentences(), HasSubstr("--root-motion"));
}

TEST_F(Cases, RootMotionIsDerivedFromTheStandingFoot) {
  const std::string base = ExpectSixSteps(Build("m00_base.bvh"));
  const std::string derived = ExpectSixSteps(Build("m11_in_place.bvh", {"--root-motion"}));
  ASSERT_FALSE(base.empty() || derived.empty());
  // The walk ends where that of the base case ends.
  const BvhPositions a(base);
  const BvhPositions b(derived);
  EXPECT_NEAR(a.At(a.frame_count() - 1)[0].z, b.At(b.frame_count() - 1)[0].z, 0.1);
}

TEST_F(Cases, MissingLegIsAnError) {
  const ToolBuild build = Build("m14_one_leg.bvh");
  ExpectRefused(build);
  EXPECT_THAT(build.Sentences(), HasSubstr("left leg"));
}

TEST_F(Cases, DecimalCommaIsNamed) {
  const ToolBuild build = Build("m15_decimal_comma.bvh");
  EXPECT_THAT(build.Sentences(), HasSubstr("comma"));
  if (build.exit_code == 0) {
    EXPECT_THAT(build.Steps(), ElementsAre(3, 3));
  }
}

TEST_F(Cases, DeclaredZeroFramesGetsANote) {
  const ToolBuild build = Build("m16_frames_0.bvh");
  (void)ExpectSixSteps(build);
  EXPECT_THAT(build.Sentences(), HasSubstr("Frames:"));
}

TEST_F(Cases, SecondRootIsLeftOut) {
  const ToolBuild build = Build("m18_second_root.bvh");
  (void)ExpectSixSteps(build);
  EXPECT_THAT(build.Sentences(), HasSubstr("Prop"));
  ExpectSame("m18_second_root.bvh");
}

TEST_F(Cases, LyingFigureStaysLying) {
  const ToolBuild build = Build("m19_lying.bvh");
  ExpectRefused(build);
  EXPECT_THAT(build.Sentences(), Not(HasSubstr("-z")));
  EXPECT_THAT(build.Sentences(), AnyOf(HasSubstr("lie"), HasSubstr("lying")));
  const auto capture = ReadBvh(CaseFile("m19_lying.bvh"));
  ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
  const ConstPoseSpan pose = capture->clip.frame(0);
  EXPECT_NEAR(pose.root_position_m.y, 0.12, 0.01);
  for (const Leg& leg : capture->skeleton.legs) {
    EXPECT_NEAR(PointPosition(capture->skeleton, pose, leg.ankle, Vec3(0.0f)).y, 0.12, 0.05);
  }
}

TEST_F(Cases, TooFastJumpIsRefusedWithAFrameRate) {
  const ToolBuild build = Build("m22_jump_30pct_too_fast.bvh");
  ExpectRefused(build);
  EXPECT_EQ(build.Jumps(), 0);
  EXPECT_THAT(build.Sentences(), HasSubstr("17"));
  EXPECT_THAT(build.Sentences(), HasSubstr("m/s^2"));
  EXPECT_THAT(build.Sentences(), HasSubstr("33 frames"));
}

TEST_F(Cases, WalkWithoutStandReachesAGoal) {
  const ToolBuild build = Build("m24_walk_without_stand.bvh");
  ASSERT_EQ(build.exit_code, 0) << build.err;
  const ToolSynthesis synthesis =
      SynthesizeWithTool(folder_, build.library, CaseFile("c_walk_to_3m.json"));
  ASSERT_EQ(synthesis.exit_code, 0) << synthesis.err;
  std::vector<std::string> kinds;
  std::vector<double> lengths_m[2];
  for (const json& movement : synthesis.report["movements"]) {
    const std::string kind = movement["kind"];
    if (!kind.starts_with("step")) continue;
    if (!kinds.empty()) {
      EXPECT_NE(kind, kinds.back()) << "the figure limps";
    }
    kinds.push_back(kind);
    lengths_m[kind == "step_left" ? 0 : 1].push_back(
        movement.at("measured").at("end_z_m").get<double>());
  }
  ASSERT_GE(kinds.size(), 4u);
  const BvhPositions positions(synthesis.bvh);
  const double left_z = positions.At(0, "LeftFoot").z;
  const double right_z = positions.At(0, "RightFoot").z;
  if (std::fabs(left_z - right_z) > 0.03) {
    EXPECT_EQ(kinds.front(), left_z < right_z ? "step_left" : "step_right");
  }
  // Without the last step, which may close the feet, both feet take steps of equal length.
  lengths_m[kinds.back() == "step_left" ? 0 : 1].pop_back();
  double longest = 0.0;
  double shortest = 10.0;
  for (const std::vector<double>& lengths : lengths_m) {
    for (const double length : lengths) {
      longest = std::max(longest, length);
      shortest = std::min(shortest, length);
    }
  }
  EXPECT_GT(shortest, 0.5 * longest) << "the figure limps";
  const std::vector<DVec3> last = positions.At(positions.frame_count() - 1);
  EXPECT_NEAR(last[0].z, 3.0, 0.5 * longest);
  EXPECT_NEAR(last[0].x, 0.0, 0.5 * longest);
}

}  // namespace
}  // namespace stridewire::test
