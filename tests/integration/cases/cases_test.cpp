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

}  // namespace
}  // namespace stridewire::test
