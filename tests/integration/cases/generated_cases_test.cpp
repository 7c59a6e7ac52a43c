// Builds libraries from generated files that reproduce faults of public files.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "corpus/bvh_notation.h"
#include "corpus/bvh_positions.h"
#include "corpus/corpus_case.h"
#include "corpus/gait.h"
#include "corpus/postures.h"
#include "corpus/rig.h"
#include "corpus/rig_names.h"
#include "scratch_folder.h"
#include "stridewire/offline/bvh_reader.h"
#include "tool_build.h"

namespace stridewire::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr double kFps = 60.0;
constexpr const char* kFourSteps =
    R"({"movements":[{"stand":{"seconds":0.5}},{"step":{"foot":"left","length_m":0.5}},
    {"step":{"length_m":0.5}},{"step":{"length_m":0.5}},{"step":{"length_m":0.5}},
    {"stand":{"seconds":1}}]})";

const NameStyle& Style(std::string_view label) {
  for (const NameStyle& style : NameStyles()) {
    if (label == style.label) return style;
  }
  throw std::logic_error("no such style");
}

// Eight jointed legs below a body that moves forward, with the names of legs.
Rig Crab() {
  Rig rig;
  rig.fps = kFps;
  rig.parts.fill(-1);
  constexpr int kFrames = 240;
  const auto add = [&](const std::string& name, int parent, const DVec3& offset) {
    RigJoint joint;
    joint.name = name;
    joint.parent = parent;
    joint.offset = offset;
    joint.rotations.assign(kFrames, DQuat(1.0, 0.0, 0.0, 0.0));
    rig.joints.push_back(std::move(joint));
    return static_cast<int>(rig.joints.size()) - 1;
  };
  add("Body", -1, DVec3(0.0));
  rig.joints[0].channels = Channels::kPositionAndRotation;
  for (int f = 0; f < kFrames; ++f) rig.joints[0].positions.push_back({0.0, 0.3, 0.005 * f});
  for (int k = 1; k <= 4; ++k) {
    for (const std::string side : {"L", "R"}) {
      const double x = side == "L" ? 1.0 : -1.0;
      const std::string end = std::to_string(k) + "." + side;
      const int thigh = add("thigh" + end, 0, DVec3(0.2 * x, 0.0, 0.3 - 0.15 * k));
      const int shin = add("shin" + end, thigh, DVec3(0.3 * x, 0.2, 0.0));
      const int foot = add("foot" + end, shin, DVec3(0.2 * x, -0.45, 0.0));
      rig.joints[static_cast<std::size_t>(foot)].end_sites = {DVec3(0.02 * x, -0.05, 0.0)};
      for (int f = 0; f < kFrames; ++f) {
        const double swing = 0.3 * std::sin(0.2 * f + 1.6 * k + x);
        rig.joints[static_cast<std::size_t>(thigh)].rotations[static_cast<std::size_t>(f)] =
            AboutY(swing) * AboutZ(x * std::max(0.0, swing));
      }
    }
  }
  return rig;
}

class GeneratedCases : public testing::Test {
 protected:
  [[nodiscard]] Rig Walk(const WalkOptions& options = {}) const {
    Rig rig = MakeRig(figure_, RenderGait(figure_, PlanWalk(figure_, options), kFps));
    Scale(100.0, rig);
    return rig;
  }

  [[nodiscard]] ToolBuild Build(const Rig& rig, const BvhNotation& notation = {},
                                const std::vector<std::string>& options = {}) const {
    return BuildWithTool(folder_, folder_.Write("case.bvh", WriteRig(rig, notation)), options);
  }

  [[nodiscard]] std::string FourSteps(const ToolBuild& build) const {
    EXPECT_EQ(build.exit_code, 0) << build.err;
    if (build.exit_code != 0) return {};
    const ToolSynthesis synthesis =
        SynthesizeWithTool(folder_, build.library, folder_.Write("four.json", kFourSteps));
    EXPECT_EQ(synthesis.exit_code, 0) << synthesis.err;
    return synthesis.bvh;
  }

  static void ExpectSixSteps(const ToolBuild& build) {
    EXPECT_EQ(build.exit_code, 0) << build.err;
    EXPECT_THAT(build.Steps(), ElementsAre(3, 3)) << build.Sentences();
  }

  // Expects a report without steps whose file has at least one sentence.
  static void ExpectRefused(const ToolBuild& build) {
    EXPECT_EQ(build.exit_code, 2);
    EXPECT_FALSE(build.report.is_null()) << "no report; stderr: " << build.err;
    EXPECT_THAT(build.Sentences(), Not(IsEmpty()));
  }

  const Figure figure_;
  const ScratchFolder folder_;
};

TEST_F(GeneratedCases, RefusedFilesGetAReportWithAReason) {
  for (const Movement movement :
       {Movement::kOneFrame, Movement::kFrozen, Movement::kStand, Movement::kMarch,
        Movement::kDance, Movement::kSit, Movement::kLie, Movement::kCrawl, Movement::kHang}) {
    SCOPED_TRACE(MovementName(movement));
    const CorpusCase file = DrawCase(movement, 11);
    ExpectRefused(BuildWithTool(folder_, folder_.Write("case.bvh", file.bvh)));
  }
}

TEST_F(GeneratedCases, SlowMotionGetsANote) {
  Rig rig = Walk();
  rig.fps = 0.25 * kFps;
  EXPECT_THAT(Build(rig).Sentences(), HasSubstr("Frame Time"));
}

TEST_F(GeneratedCases, RecordingWithoutDoubleSupportIsRefused) {
  FigureMotion motion = RenderGait(figure_, PlanWalk(figure_, {.steps = 1}), kFps);
  // Keeps the middle of the only swing.
  motion.poses = {motion.poses.begin() + 70, motion.poses.begin() + 86};
  ExpectRefused(Build(MakeRig(figure_, motion)));
}

TEST_F(GeneratedCases, StepsOfOneFootAreReportedWithTheOptionThatHelps) {
  const ToolBuild build = Build(Walk({.steps = 1, .stops = false}));
  EXPECT_EQ(build.exit_code, 0) << build.err;
  EXPECT_THAT(build.report.dump(), HasSubstr("--mirror"));
}

TEST_F(GeneratedCases, HoveringFootIsNotAStep) {
  const ToolBuild build = Build(MakeRig(figure_, DanceOnOneLeg(figure_, kFps, 20.0)));
  ExpectRefused(build);
  EXPECT_THAT(build.Steps(), ElementsAre(0, 0));
}

TEST_F(GeneratedCases, CrawlingIsNotWalking) {
  const ToolBuild build = Build(MakeRig(figure_, Crawl(figure_, kFps, 8.0)));
  ExpectRefused(build);
  EXPECT_THAT(build.Steps(), ElementsAre(0, 0));
}

TEST_F(GeneratedCases, CrabIsNotAPerson) {
  const ToolBuild build = Build(Crab());
  ExpectRefused(build);
  EXPECT_THAT(build.Sentences(), HasSubstr("legs"));
}

TEST_F(GeneratedCases, EitherLegMayBeMissing) {
  for (int foot = 0; foot < 2; ++foot) {
    Rig rig = Walk();
    RemoveLeg(foot, rig);
    const ToolBuild build = Build(rig);
    ExpectRefused(build);
    EXPECT_THAT(build.Sentences(), HasSubstr(foot == 0 ? "left leg" : "right leg"));
  }
}

TEST_F(GeneratedCases, LyingFigureKeepsItsUpAxis) {
  for (const bool is_z_up : {false, true}) {
    SCOPED_TRACE(is_z_up);
    Rig rig = MakeRig(figure_, Lie(figure_, kFps, 4.0));
    if (is_z_up) TurnWorld(AboutX(90.0 * kDegree), rig);
    const auto capture = ParseBvh(WriteRig(rig, {}), "lie.bvh");
    ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
    for (int f = 0; f < capture->clip.frame_count(); ++f) {
      EXPECT_NEAR(capture->clip.frame(f).root_position_m.y, 0.13, 0.01);
    }
  }
}

TEST_F(GeneratedCases, FeetCloseBeforeStanding) {
  const std::string bvh = FourSteps(Build(Walk(), {}, {"--mirror"}));
  const BvhPositions positions(bvh);
  const int last = positions.frame_count() - 1;
  const DVec3 apart = positions.At(last, "LeftFoot") - positions.At(last, "RightFoot");
  EXPECT_NEAR(apart.z, 0.0, 0.03);
  EXPECT_GT(apart.x, 0.1);
}

TEST_F(GeneratedCases, RunIsCalledARun) {
  const ToolBuild build = Build(MakeRig(figure_, RenderGait(figure_, PlanRun(figure_, {}), kFps)));
  ExpectRefused(build);
  EXPECT_THAT(build.Sentences(), HasSubstr("run"));
}

TEST_F(GeneratedCases, TwistJointsAreNotKnees) {
  const std::string plain = FourSteps(Build(Walk()));
  for (const char* label : {"CMU", "Mixamo in glTF", "Unreal", "Rigify", "Character Creator"}) {
    SCOPED_TRACE(label);
    Rig rig = Walk();
    AddTwistJoints(TwistPlace::kInside, rig);
    NameJoints(Style(label), rig);
    const ToolBuild build = Build(rig);
    ExpectSixSteps(build);
    EXPECT_THAT(build.Sentences(), HasSubstr("the legs are then 0.86 m long"));
  }
}

TEST_F(GeneratedCases, SideAndPartAreReadFromTheEndOfANameWithAPrefix) {
  for (const NameStyle& style : NameStyles()) {
    if (style.is_anonymous()) continue;
    SCOPED_TRACE(style.label);
    Rig rig = Walk({.steps = 5});
    NameJoints(style, rig);
    const ToolBuild build = Build(rig);
    EXPECT_EQ(build.exit_code, 0) << build.err;
    EXPECT_THAT(build.Steps(), ElementsAre(3, 2)) << build.Sentences();
    EXPECT_THAT(build.Sentences(), Not(HasSubstr("shape")));
  }
}

TEST_F(GeneratedCases, FloorThatRisesByOneCentimetrePerMetreLosesNoStep) {
  for (const double slope : {-0.01, 0.01}) {
    SCOPED_TRACE(slope);
    const ToolBuild build = Build(Walk({.steps = 10, .slope_z = slope}));
    EXPECT_THAT(build.Steps(), ElementsAre(5, 5)) << build.Sentences();
  }
}

TEST_F(GeneratedCases, KerbOfAnyHeightLosesNoStep) {
  for (const double rise_m : {0.05, 0.06, 0.07, 0.08, 0.099, 0.1, -0.05, -0.08}) {
    SCOPED_TRACE(rise_m);
    ExpectSixSteps(Build(Walk({.rises_m = {0.0, 0.0, 0.0, rise_m}})));
  }
}

TEST_F(GeneratedCases, WrappedRowsAreAcceptedWithANote) {
  const ToolBuild build = Build(Walk(), {.numbers_per_line = 10});
  ExpectSixSteps(build);
  EXPECT_THAT(build.Sentences(), HasSubstr("next line"));
}

TEST_F(GeneratedCases, FractionalFrameCountIsAcceptedWithANote) {
  const Rig rig = Walk();
  const ToolBuild build = Build(rig, {.frames_text = std::to_string(rig.frame_count()) + ".0"});
  ExpectSixSteps(build);
  EXPECT_THAT(build.Sentences(), HasSubstr("number of frames"));
}

TEST_F(GeneratedCases, CommentsBeforeTheHierarchyAreAccepted) {
  ExpectSixSteps(Build(Walk(), {.comment = "# exported by a program"}));
}

TEST_F(GeneratedCases, ScaleChannelsAreAcceptedWithANote) {
  const ToolBuild build = Build(Walk(), {.positions_everywhere = true, .scales = true});
  ExpectSixSteps(build);
  EXPECT_THAT(build.Sentences(), HasSubstr("scale"));
}

TEST_F(GeneratedCases, EveryRootGivesTheSameMotion) {
  const std::string plain = FourSteps(Build(Walk()));
  for (const Roots roots : {Roots::kStatic, Roots::kRotated, Roots::kTrajectory, Roots::kSplit}) {
    SCOPED_TRACE(static_cast<int>(roots));
    Rig rig = Walk();
    Scale(0.01, rig);
    AddRoots(roots, rig);
    Scale(100.0, rig);
    const ToolBuild build = Build(rig);
    ExpectSixSteps(build);
    const std::string bvh = FourSteps(build);
    if (!bvh.empty()) {
      EXPECT_LT(LargestJointDistance(plain, bvh), kSameMotionM);
    }
  }
}

TEST_F(GeneratedCases, EveryFrameOfTheJointsGivesTheSameMotion) {
  const std::string plain = FourSteps(Build(Walk()));
  for (const Frames frames : {Frames::kLegsDown, Frames::kLegsAside, Frames::kAlongBones,
                              Frames::kQuarters, Frames::kRandom}) {
    SCOPED_TRACE(static_cast<int>(frames));
    Rig rig = Walk();
    Random random(4);
    ReFrame(frames, random, rig);
    const ToolBuild build = Build(rig);
    ExpectSixSteps(build);
    const std::string bvh = FourSteps(build);
    if (!bvh.empty()) {
      EXPECT_LT(LargestJointDistance(plain, bvh), kSameMotionM);
    }
  }
}

}  // namespace
}  // namespace stridewire::test
