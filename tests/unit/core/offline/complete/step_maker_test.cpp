#include "offline/complete/step_maker.h"

#include <gtest/gtest.h>

#include <array>

#include "offline/builtin/figure.h"
#include "offline/builtin/step.h"
#include "offline/complete/generic_stride.h"
#include "offline/extract/bend_toes.h"
#include "runtime/library/knee_hinges.h"

namespace stridewire::complete {
namespace {

constexpr std::array kCells = {4, 24, 4};

// The generated figure with its own strides.
struct Walker {
  Skeleton skeleton = builtin::MakeFigure();
  Pose stand{builtin::kFigureJointCount};
  Person person;

  Walker() : person{.skeleton = skeleton, .rig = {}, .stand = {}, .strides = {}} {
    builtin::StorePose(builtin::StandingPose(), stand);
    const RawExample step = builtin::MakeStep(
        skeleton, Foot::kLeft, builtin::StraightShape(Foot::kLeft, 0.5, 0.5), {}, "");
    const std::array clips = {&step.clip};
    person.rig = MakeLegRig(skeleton, stand, LearnKneeHinges(skeleton, stand, clips));
    person.stand = SampleOf(skeleton, stand, 0.0);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      person.strides[static_cast<std::size_t>(foot)] =
          GenericStride(skeleton, person.rig, person.stand, foot);
    }
    JoinStrides(person.strides);
    MeasureLegs(skeleton, person.rig, person.strides);
  }

  [[nodiscard]] RawExample Stride(double length_m) const {
    const double width_m = person.strides[0].width_m;
    return MakeStep(person,
                    {.moving = Foot::kLeft,
                     .feet = {DVec3(width_m, 0.0, -length_m), DVec3(width_m, 0.0, length_m), 0.0}},
                    kCells, {}, "");
  }
};

TEST(StepMaker, ToesBendWhereTheirTipsWouldSink) {
  Walker walker;
  for (StrideModel& stride : walker.person.strides) {
    for (PostureSample& point : stride.points) {
      for (const auto toe : {builtin::kLeftToeBase, builtin::kRightToeBase}) {
        point.rotations[toe] = walker.person.stand.rotations[toe];
      }
    }
  }
  for (const double length_m : {0.2, 0.4, walker.person.strides[0].end_length_m}) {
    const RawExample example = walker.Stride(length_m);
    for (int i = 0; i < example.clip.frame_count(); ++i) {
      for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
        LegPose leg;
        const ConstPoseSpan pose = example.clip.frame(i);
        EvaluateLeg(walker.skeleton, walker.person.rig, pose, foot, leg);
        EXPECT_GT(pose.root_position_m.y + leg.toe_tip_m.y,
                  walker.person.rig.side(foot).toe_height_m - kMaxToeSinkM - 1e-4)
            << length_m << ' ' << i;
      }
    }
  }
}

}  // namespace
}  // namespace stridewire::complete
