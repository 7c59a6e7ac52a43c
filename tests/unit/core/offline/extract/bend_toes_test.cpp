#include "offline/extract/bend_toes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "offline/base/degrees.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step.h"
#include "runtime/library/knee_hinges.h"

namespace stridewire {
namespace {

constexpr std::array kToes = {builtin::kLeftToeBase, builtin::kRightToeBase};

// A step of each foot of the generated figure. Its toes do not bend, as in many captures.
struct StiffToes {
  RawLibrary library;
  LegRig rig;
  std::array<double, 2> ball_height_m{};

  StiffToes() {
    library.skeleton = builtin::MakeFigure();
    library.stand_pose = Pose(builtin::kFigureJointCount);
    builtin::StorePose(builtin::StandingPose(), library.stand_pose);
    for (const Foot moving : {Foot::kLeft, Foot::kRight}) {
      RawGroup& group = library.groups.emplace_back();
      group.kind = StepKind(moving);
      group.examples.push_back(builtin::MakeStep(
          library.skeleton, moving, builtin::StraightShape(moving, 0.55, 0.55), {}, ""));
      Clip& clip = group.examples.front().clip;
      for (int i = 0; i < clip.frame_count(); ++i) {
        for (const auto toe : kToes)
          clip.frame(i).rotations[toe] = library.stand_pose.rotations[toe];
      }
    }
    const std::array clips = {&library.groups.front().examples.front().clip};
    rig = MakeLegRig(library.skeleton, library.stand_pose,
                     LearnKneeHinges(library.skeleton, library.stand_pose, clips));
    for (std::size_t f = 0; f < 2; ++f) ball_height_m[f] = rig.sides[f].ball_height_m;
  }

  // Height of the toe tip above the ground, minus its height in the stand pose.
  [[nodiscard]] double TipAbove(ConstPoseSpan pose, Foot foot) const {
    LegPose leg;
    EvaluateLeg(library.skeleton, rig, pose, foot, leg);
    return pose.root_position_m.y + leg.toe_tip_m.y - rig.side(foot).toe_height_m;
  }
  [[nodiscard]] double LowestTip() const {
    double lowest_m = HUGE_VAL;
    for (const RawGroup& group : library.groups) {
      const Clip& clip = group.examples.front().clip;
      for (int i = 0; i < clip.frame_count(); ++i) {
        for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
          lowest_m = std::min(lowest_m, TipAbove(clip.frame(i), foot));
        }
      }
    }
    return lowest_m;
  }
};

TEST(BendToes, TipsThatSinkWhenTheFootPushesOffStayOnTheGround) {
  StiffToes steps;
  ASSERT_LT(steps.LowestTip(), -0.015);
  const Clip before = steps.library.groups[0].examples[0].clip;
  BendToes(steps.rig, steps.ball_height_m, steps.library);
  EXPECT_GT(steps.LowestTip(), -kMaxToeSinkM - 0.002);
  const Clip& after = steps.library.groups[0].examples[0].clip;
  for (int i = 0; i < after.frame_count(); ++i) {
    EXPECT_EQ(after.frame(i).root_position_m, before.frame(i).root_position_m);
    for (std::size_t j = 0; j < builtin::kFigureJointCount; ++j) {
      if (std::ranges::find(kToes, j) != kToes.end()) continue;
      EXPECT_EQ(after.frame(i).rotations[j], before.frame(i).rotations[j]) << i << ' ' << j;
    }
  }
}

TEST(BendToes, RaisesATipToTheHeight) {
  const StiffToes steps;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    Pose pose = steps.library.stand_pose;
    RaiseToeTip(steps.library.skeleton, steps.rig, foot, steps.rig.side(foot).toe_height_m + 0.03,
                pose);
    EXPECT_NEAR(steps.TipAbove(pose, foot), 0.03, 1e-5);
    EXPECT_NEAR(steps.TipAbove(pose, OtherFoot(foot)), 0.0, 1e-9);
  }
}

TEST(BendToes, LeavesAHigherTipAsItIs) {
  const StiffToes steps;
  Pose pose = steps.library.stand_pose;
  RaiseToeTip(steps.library.skeleton, steps.rig, Foot::kLeft,
              steps.rig.side(Foot::kLeft).toe_height_m - 0.001, pose);
  EXPECT_EQ(pose.rotations, steps.library.stand_pose.rotations);
}

TEST(BendToes, BendsByAtMost60Degrees) {
  const StiffToes steps;
  Pose pose = steps.library.stand_pose;
  RaiseToeTip(steps.library.skeleton, steps.rig, Foot::kLeft, 5.0, pose);
  const Quat turn = glm::conjugate(steps.library.stand_pose.rotations[builtin::kLeftToeBase]) *
                    pose.rotations[builtin::kLeftToeBase];
  const double bend_deg = kDegreesPerRadian * 2.0 * std::acos(std::fabs(double{turn.w}));
  EXPECT_NEAR(bend_deg, 60.0, 0.5);
}

TEST(BendToes, DoesNothingWithoutAToeJoint) {
  StiffToes steps;
  for (LegRig::Side& side : steps.rig.sides) side.has_toe_joint = false;
  Pose pose = steps.library.stand_pose;
  RaiseToeTip(steps.library.skeleton, steps.rig, Foot::kLeft, 0.1, pose);
  EXPECT_EQ(pose.rotations, steps.library.stand_pose.rotations);
}

}  // namespace
}  // namespace stridewire
