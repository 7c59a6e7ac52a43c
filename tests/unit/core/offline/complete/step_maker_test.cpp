#include "offline/complete/step_maker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "offline/build/bend_toes.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step.h"
#include "offline/builtin/swing_detour.h"
#include "offline/complete/generic_stride.h"
#include "runtime/library/knee_hinges.h"
#include "runtime/skeleton/foot_vector.h"

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

// Distance from the fixed to the moving foot at a time.
double AheadAt(const Walker& walker, const RawExample& example, double time_s) {
  Pose pose(builtin::kFigureJointCount);
  SampleClip(example.clip, time_s, pose);
  return FootVector(walker.skeleton, pose, Foot::kLeft, 0.0).z;
}

// If a generated foot were ahead of the captured one, the leg could not reach it unless the body
// crouched.
TEST(StepMaker, FeetDoNotArriveEarlierThanCapturedOnes) {
  Walker walker;
  StrideModel& stride = walker.person.strides[0];
  const double length_m = stride.end_length_m;
  const RawExample usual = walker.Stride(length_m);
  // The captured foot is slower in the second half of its swing.
  for (std::size_t p = 0; p < stride.points.size(); ++p) {
    const double generic = static_cast<double>(p) / kPointsPerInterval;
    const double late = std::clamp(2.0 * (generic - 1.5), 0.0, 1.0);
    stride.points[p].balls_m[0].z -= 0.12 * 4.0 * late * (1.0 - late);
  }
  const RawExample late = walker.Stride(length_m);
  const double time_s = 0.3 * late.keytimes_s[1] + 0.7 * late.keytimes_s[2];
  EXPECT_LT(AheadAt(walker, late, time_s), AheadAt(walker, usual, time_s) - 0.03);
  EXPECT_NEAR(AheadAt(walker, late, late.keytimes_s.back()), length_m, 1e-4);
}

// The pelvis of a person turns and tilts almost as far in short strides as in long ones.
TEST(StepMaker, PelvisTurnsAlmostAsFarInShortStrides) {
  const Walker walker;
  // Returns the largest angle between the rotations of the pelvis in a stride and in the stand.
  const auto turned_rad = [&](double length_m) {
    const RawExample stride = walker.Stride(length_m);
    double largest = 0.0;
    for (int i = 0; i < stride.clip.frame_count(); ++i) {
      const DQuat turn = glm::conjugate(walker.person.stand.rotations[0]) *
                         DQuat(stride.clip.frame(i).rotations[0]);
      largest = std::max(
          largest, 2.0 * std::asin(std::min(1.0, glm::length(DVec3(turn.x, turn.y, turn.z)))));
    }
    return largest;
  };
  const double full_m = walker.person.strides[0].end_length_m;
  const double full_rad = turned_rad(full_m);
  ASSERT_GT(full_rad, 0.03);
  EXPECT_GT(turned_rad(0.6 * full_m), 0.75 * full_rad);
  EXPECT_LT(turned_rad(0.3 * full_m), 0.8 * full_rad);
}

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

// Rounding errors of the distances must not change the detour by a whole increment.
TEST(FindExactDetour, DependsContinuouslyOnTheDistances) {
  const builtin::DetourRange range = {.max_m = 0.35, .step_m = 0.01, .clearance_m = 0.09};
  const auto detour_m = [&](double at_zero_m, double most_m) {
    return builtin::FindExactDetour(
        range, [&](double tried_m) { return std::min(at_zero_m + 0.5 * tried_m, most_m); });
  };
  const double enough_m = range.clearance_m - builtin::kSmallestGainM;
  for (const double error_m : {-1e-6, 0.0, 1e-6}) {
    // The clearance is reached after 0.06 m, exactly after six increments.
    EXPECT_NEAR(detour_m(0.06 + error_m, 1.0), 2.0 * (enough_m - 0.06), 5e-6);
    // The distance does not exceed 0.07 m, for example because of the landing.
    EXPECT_NEAR(detour_m(0.06 + error_m, 0.07), 2.0 * (0.069 - 0.06), 5e-6);
    EXPECT_EQ(detour_m(0.09 + error_m, 1.0), 0.0);
    EXPECT_EQ(detour_m(0.03, 0.03 + error_m), 0.0);
  }
}

}  // namespace
}  // namespace stridewire::complete
