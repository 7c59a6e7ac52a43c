#include "offline/build/bend_toes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "offline/base/degrees.h"
#include "offline/build/grid_cells.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step.h"

namespace stridewire {
namespace {

constexpr std::array kToes = {builtin::kLeftToeBase, builtin::kRightToeBase};

// A step of each foot of the generated figure. Its toes do not bend, as in many captures.
struct StiffToes {
  RawLibrary library;
  LegRig rig;

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
    rig = MakeLegRig(library.skeleton, library.stand_pose, {});
  }

  // Height of the toe tip above the ground, minus its height in the stand pose.
  [[nodiscard]] double TipAbove(ConstPoseSpan pose, Foot foot) const {
    LegPose leg;
    EvaluateLeg(library.skeleton, rig, pose, foot, leg);
    return pose.root_position_m.y + leg.toe_tip_m.y - rig.side(foot).toe_height_m;
  }
};

TEST(BendToes, TipsThatSinkWhenTheFootPushesOffStayOnTheGround) {
  const StiffToes steps;
  const GridLayout layout(builtin::kFigureJointCount);
  const ToeBender bender(steps.library);
  const auto pose_at = [&](const GridExample& example, std::size_t at) {
    const auto row_floats = static_cast<std::size_t>(layout.row_floats);
    return PoseOfRow(std::span(example.rows).subspan(at, row_floats), layout, layout.joint_count);
  };
  const auto lowest_tip_m = [&](const GridExample& example) {
    double lowest_m = HUGE_VAL;
    for (std::size_t at = 0; at < example.rows.size(); at += layout.row_floats) {
      const Pose pose = pose_at(example, at);
      for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
        lowest_m = std::min(lowest_m, steps.TipAbove(pose, foot));
      }
    }
    return lowest_m;
  };
  for (const RawGroup& group : steps.library.groups) {
    const RawExample& step = group.examples.front();
    const std::vector<int> cells = CellsAtRate({step.keytimes_s}, 60.0);
    const GridExample before =
        ResampleOnGrid(step, cells, layout, steps.library.stand_pose.rotations[0]);
    ASSERT_LT(lowest_tip_m(before), -0.015);
    GridExample after = before;
    bender.Bend(group.kind, cells, layout, 0.0, after);
    EXPECT_GT(lowest_tip_m(after), -kMaxToeSinkM - 1e-4);
    for (std::size_t at = 0; at < after.rows.size(); at += layout.row_floats) {
      const Pose then = pose_at(before, at);
      const Pose now = pose_at(after, at);
      EXPECT_EQ(now.root_position_m, then.root_position_m);
      for (std::size_t j = 0; j < builtin::kFigureJointCount; ++j) {
        if (std::ranges::find(kToes, j) != kToes.end()) continue;
        EXPECT_EQ(now.rotations[j], then.rotations[j]) << at << ' ' << j;
      }
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
