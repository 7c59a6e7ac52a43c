// Extraction from a synthetic figure with known contacts, lengths and headings.
#include "offline/extract/extract.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "runtime/library/keytimes.h"
#include "runtime/skeleton/foot_vector.h"
#include "synthetic_walker.h"

namespace stridewire {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

std::vector<WalkerStep> StartWalkStop() {
  return {{Foot::kLeft, 0.5},
          {Foot::kRight, 0.6},
          {Foot::kLeft, 0.55},
          {Foot::kRight, 0.6},
          {Foot::kLeft, 0.0}};
}

TEST(Extract, FindsStepsWithTheirLengthsAndTimes) {
  SyntheticWalker walker;
  walker.heading_rad = 0.7;
  walker.start_m = DVec3(3.0, 0.0, -2.0);
  const Extraction found = Extract(walker.Walk(StartWalkStop()));
  EXPECT_EQ(found.error, "");
  EXPECT_EQ(found.steps_left, 3);
  EXPECT_EQ(found.steps_right, 2);
  EXPECT_EQ(found.jumps, 0);
  EXPECT_THAT(found.rejected, ::testing::IsEmpty());
  ASSERT_EQ(found.straight_steps.size(), 5u);
  const double start[] = {0.0, -0.5, -0.6, -0.55, -0.6};
  const double end[] = {0.5, 0.6, 0.55, 0.6, 0.0};
  for (std::size_t i = 0; i < 5; ++i) {
    const ExtractedExample& step = found.straight_steps[i];
    EXPECT_EQ(step.kind, i % 2 == 0 ? MovementKind::kStepLeft : MovementKind::kStepRight);
    EXPECT_NEAR(step.example.parameters[0], start[i], 0.01) << i;
    EXPECT_NEAR(step.example.parameters[1], end[i], 0.01) << i;
    ASSERT_EQ(step.example.keytimes_s.size(), 4u);
    EXPECT_TRUE(ValidateKeytimes(step.example.keytimes_s).has_value());
    // The foot accelerates from rest and needs 40 to 70 ms to exceed the speed limit of contacts.
    double from = 0.0;
    ASSERT_EQ(std::sscanf(step.example.source.c_str(), "synthetic.bvh %lf-", &from), 1);
    EXPECT_NEAR(from + step.example.keytimes_s[1], walker.truth.toe_off_s[i], 0.08) << i;
    EXPECT_NEAR(from + step.example.keytimes_s[2], walker.truth.heel_strike_s[i], 0.08) << i;
    EXPECT_DOUBLE_EQ(step.example.clip.duration_s(), step.example.keytimes_s[3]);
  }
  // Each step starts where the previous one ended, in the middle of double support.
  for (std::size_t i = 1; i + 2 < 5; ++i) {
    EXPECT_NEAR(found.straight_steps[i].example.keytimes_s[1], 0.1, 0.05);
  }
}

TEST(Extract, NormalisesPositionHeadingAndHeight) {
  for (const double heading : {-2.5, 0.0, 1.2, 3.1}) {
    SyntheticWalker walker;
    walker.heading_rad = heading;
    walker.start_m = DVec3(-4.0, 0.0, 7.0);
    const Extraction found = Extract(walker.Walk(StartWalkStop()));
    ASSERT_EQ(found.straight_steps.size(), 5u) << heading;
    for (const ExtractedExample& step : found.straight_steps) {
      const ConstPoseSpan first = step.example.clip.frame(0);
      EXPECT_NEAR(first.root_position_m.x, 0.0, 1e-6);
      EXPECT_NEAR(first.root_position_m.z, 0.0, 1e-6);
      EXPECT_NEAR(first.root_position_m.y, 0.86, 0.005);
      double yaw = 1.0;
      ASSERT_TRUE(HeadingOf(first.rotations[0], yaw));
      EXPECT_NEAR(yaw, 0.0, 0.01) << heading;
      const ConstPoseSpan last = step.example.clip.frame(step.example.clip.frame_count() - 1);
      EXPECT_NEAR(last.root_position_m.x, 0.0, 0.002) << "the step veers";
      EXPECT_GT(last.root_position_m.z, 0.2);
      EXPECT_NEAR(BallPosition(found.skeleton, last, Foot::kLeft).y, kWalkerBallHeightM, 0.002);
    }
  }
}

TEST(Extract, HeadingIgnoresPelvisOscillation) {
  SyntheticWalker walker;
  walker.pelvis_swing_rad = 10.0 * kDegree;
  std::vector<WalkerStep> steps;
  for (int i = 0; i < 10; ++i) steps.push_back({i % 2 == 0 ? Foot::kLeft : Foot::kRight, 0.5});
  const Extraction found = Extract(walker.Walk(steps));
  ASSERT_EQ(found.general_steps.size(), 10u);
  for (std::size_t i = 2; i < 8; ++i) {
    EXPECT_NEAR(found.general_steps[i].example.parameters[6], 0.0, 1.5 * kDegree) << i;
    EXPECT_NEAR(found.general_steps[i].example.parameters[5], 0.5, 0.01) << i;
  }
  EXPECT_GE(found.straight_steps.size(), 8u);
}

TEST(Extract, GeneralParametersAreTheFootVectorsOfTheClip) {
  SyntheticWalker walker;
  const Extraction found = Extract(walker.Walk(StartWalkStop()));
  for (const ExtractedExample& step : found.general_steps) {
    const RawExample& example = step.example;
    const Foot moving = MovingFoot(step.kind);
    const DVec3 start = FootVector(found.skeleton, example.clip.frame(0), moving, 0.0);
    const DVec3 end = FootVector(found.skeleton, example.clip.frame(example.clip.frame_count() - 1),
                                 moving, example.heading_change_rad);
    const double expected[] = {
        start.x, start.y, start.z, end.x, end.y, end.z, example.heading_change_rad};
    for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(example.parameters[i], expected[i], 1e-5) << i;
  }
}

TEST(Extract, StepsOntoBlocksAreNotStraight) {
  SyntheticWalker walker;
  const Extraction found = Extract(walker.Walk({{Foot::kLeft, 0.4},
                                                {Foot::kRight, 0.4, 0.2},
                                                {Foot::kLeft, 0.4, 0.2},
                                                {Foot::kRight, 0.0},
                                                {Foot::kLeft, 0.35, -0.2},
                                                {Foot::kRight, 0.35, -0.2},
                                                {Foot::kLeft, 0.4},
                                                {Foot::kRight, 0.0}}));
  EXPECT_EQ(found.steps_left, 4);
  EXPECT_EQ(found.steps_right, 4);
  ASSERT_EQ(found.general_steps.size(), 8u);
  const double rise[] = {0.0, 0.2, 0.2, 0.0, -0.2, -0.2, 0.0, 0.0};
  for (std::size_t i = 0; i < 8; ++i) {
    const RawExample& example = found.general_steps[i].example;
    EXPECT_NEAR(example.parameters[4], rise[i], 0.01) << i;
    // The fixed foot is at y = 0, on whichever block it stands.
    const Foot fixed = OtherFoot(MovingFoot(found.general_steps[i].kind));
    EXPECT_NEAR(BallPosition(found.skeleton, example.clip.frame(0), fixed).y,
                found.ball_height_m[static_cast<int>(fixed)], 0.005)
        << i;
  }
  EXPECT_EQ(found.straight_steps.size(),
            2u);  // The first step, and the last step after climbing down.
}

TEST(Extract, FindsAStandingJump) {
  for (const double length : {0.0, 0.5, 0.9}) {
    SyntheticWalker walker;
    walker.heading_rad = -0.4;
    const Extraction found = Extract(walker.Jump(length));
    EXPECT_EQ(found.steps_left + found.steps_right, 0);
    ASSERT_EQ(found.jumps, 1) << length;
    const ExtractedExample& jump = found.jump_examples[0];
    EXPECT_TRUE(jump.settled);
    EXPECT_NEAR(jump.example.parameters[0], length, 0.01);
    EXPECT_NEAR(jump.example.parameters[1], 0.0, 0.01);
    EXPECT_NEAR(jump.example.parameters[2], 0.0, 1e-6);
    ASSERT_EQ(jump.example.keytimes_s.size(), 6u);
    EXPECT_TRUE(ValidateKeytimes(jump.example.keytimes_s).has_value());
    double from = 0.0;
    ASSERT_EQ(std::sscanf(jump.example.source.c_str(), "synthetic.bvh %lf-", &from), 1);
    EXPECT_NEAR(from + jump.example.keytimes_s[2], walker.truth.toe_off_s[0], 0.05);
    EXPECT_NEAR(from + jump.example.keytimes_s[3], walker.truth.heel_strike_s[0], 0.05);
    EXPECT_NEAR(from + jump.example.keytimes_s[1], walker.truth.toe_off_s[0] - 0.25, 0.05);
    EXPECT_NEAR(from + jump.example.keytimes_s[4], walker.truth.heel_strike_s[0] + 0.25, 0.05);
  }
}

TEST(Extract, RejectsHanging) {
  SyntheticWalker walker;
  Capture capture = walker.Jump(0.5);
  // The figure moves up and down at constant speed instead of following a parabola.
  Clip& clip = capture.clip;
  const int from = static_cast<int>(walker.truth.toe_off_s[0] * walker.fps);
  const int to = static_cast<int>(walker.truth.heel_strike_s[0] * walker.fps);
  const double y0 = clip.root_positions_m[static_cast<std::size_t>(from)].y;
  for (int f = from; f < to; ++f) {
    const double u = static_cast<double>(f - from) / (to - from);
    const double ramp = std::min({u, 1.0 - u, 0.2});
    clip.root_positions_m[static_cast<std::size_t>(f)].y = static_cast<float>(y0 + 1.5 * ramp);
  }
  const Extraction found = Extract(capture);
  EXPECT_EQ(found.jumps, 0);
  ASSERT_EQ(found.rejected.size(), 1u);
  EXPECT_THAT(found.rejected[0].reason, ::testing::HasSubstr("not falling"));
  EXPECT_NEAR(found.rejected[0].from_s, walker.truth.toe_off_s[0], 0.05);
}

TEST(Extract, FindsNoMovementsInAStandingFigure) {
  SyntheticWalker walker;
  const Extraction found = Extract(walker.Stand(3.0));
  EXPECT_EQ(found.error, "");
  EXPECT_EQ(found.steps_left + found.steps_right + found.jumps, 0);
  EXPECT_THAT(found.rejected, ::testing::IsEmpty());
  ASSERT_TRUE(found.stand.has_value());
  EXPECT_LT(found.stand->unrest, 0.01);
  EXPECT_NEAR(found.stand->pose.root_position_m.y, 0.86, 0.005);
}

TEST(Extract, StandPoseIsTheStillestUprightPose) {
  SyntheticWalker walker;
  walker.heading_rad = 2.0;
  walker.start_m = DVec3(1.0, 0.0, 1.0);
  const Extraction found = Extract(walker.Walk(StartWalkStop()));
  ASSERT_TRUE(found.stand.has_value());
  const Pose& pose = found.stand->pose;
  EXPECT_NEAR(pose.root_position_m.x, 0.0, 1e-6);
  EXPECT_NEAR(pose.root_position_m.z, 0.0, 1e-6);
  const DVec3 apart = FootVector(found.skeleton, pose, Foot::kLeft, 0.0);
  EXPECT_NEAR(apart.z, 0.0, 0.01);
  EXPECT_NEAR(apart.x, 0.18, 0.01);
}

TEST(Extract, IgnoresStepsCutOffAtTheEnds) {
  SyntheticWalker walker;
  Capture capture = walker.Walk(StartWalkStop());
  // Cuts from the middle of the second swing to the middle of the fourth.
  const auto middle = [&](std::size_t i) {
    return static_cast<int>(0.5 * (walker.truth.toe_off_s[i] + walker.truth.heel_strike_s[i]) *
                            walker.fps);
  };
  Clip cut;
  cut.fps = capture.clip.fps;
  cut.Resize(middle(3) - middle(1), capture.clip.joint_count);
  for (int f = 0; f < cut.frame_count(); ++f) {
    const ConstPoseSpan from = std::as_const(capture.clip).frame(middle(1) + f);
    const PoseSpan to = cut.frame(f);
    to.root_position_m = from.root_position_m;
    std::ranges::copy(from.rotations, to.rotations.begin());
  }
  capture.clip = cut;
  const Extraction found = Extract(capture);
  EXPECT_EQ(found.steps_left, 1);
  EXPECT_EQ(found.steps_right, 0);
  ASSERT_EQ(found.straight_steps.size(), 1u);
  EXPECT_NEAR(found.straight_steps[0].example.parameters[0], -0.6, 0.01);
  EXPECT_NEAR(found.straight_steps[0].example.parameters[1], 0.55, 0.01);
}

TEST(Extract, RejectsEmptyCaptures) {
  SyntheticWalker walker;
  Capture capture = walker.Stand(1.0);
  capture.clip = Clip{};
  capture.clip.fps = 120.0;
  const Extraction empty = Extract(capture);
  EXPECT_THAT(empty.error, ::testing::HasSubstr("no usable frame"));
  EXPECT_EQ(empty.steps_left + empty.steps_right + empty.jumps, 0);
}

TEST(Extract, HandlesVeryShortCaptures) {
  SyntheticWalker walker;
  const Capture whole = walker.Walk(StartWalkStop());
  for (const int frames : {1, 2, 3, 5, 9, 70, 90}) {
    Capture capture = whole;
    capture.clip.Resize(frames, whole.clip.joint_count);
    const Extraction found = Extract(capture);
    EXPECT_EQ(found.error, "") << frames;
    EXPECT_EQ(found.steps_left + found.steps_right + found.jumps, 0) << frames;
  }
}

TEST(Extract, IsIndependentOfTheFrameRate) {
  for (const double fps : {30.0, 60.0, 240.0}) {
    SyntheticWalker walker;
    walker.fps = fps;
    const Extraction found = Extract(walker.Walk(StartWalkStop()));
    EXPECT_EQ(found.steps_left, 3) << fps;
    EXPECT_EQ(found.steps_right, 2) << fps;
    ASSERT_EQ(found.straight_steps.size(), 5u) << fps;
    EXPECT_NEAR(found.straight_steps[1].example.parameters[1], 0.6, 0.015) << fps;
  }
}

TEST(Extract, RejectsStepsWithUnrepairedFlips) {
  SyntheticWalker walker;
  Capture capture = walker.Walk(StartWalkStop());
  const int arm = capture.skeleton.FindJoint("LeftArm");
  const int from = static_cast<int>(walker.truth.toe_off_s[1] * walker.fps) + 20;
  for (int f = from; f < capture.clip.frame_count(); ++f) {
    capture.clip.frame(f).rotations[static_cast<std::size_t>(arm)] = YawRotation(1.6);
  }
  const Extraction found = Extract(capture);
  EXPECT_EQ(found.steps_left, 3);
  EXPECT_EQ(found.steps_right, 1);
  ASSERT_EQ(found.rejected.size(), 1u);
  EXPECT_THAT(found.rejected[0].reason, ::testing::StartsWith("LeftArm turns 92 degrees"));
  EXPECT_LT(found.rejected[0].from_s, from / walker.fps);
  EXPECT_GT(found.rejected[0].to_s, from / walker.fps);
}

TEST(Extract, RetargetsToOtherBoneLengths) {
  SyntheticWalker tall;
  tall.leg_scale = 1.1;
  SyntheticWalker plain;
  const Skeleton target = plain.MakeSkeleton();
  ExtractOptions options;
  options.target = &target;
  const Extraction found = Extract(tall.Walk(StartWalkStop()), options);
  ASSERT_EQ(found.straight_steps.size(), 5u);
  EXPECT_NEAR(found.straight_steps[1].example.parameters[1], 0.6, 0.01);
  EXPECT_NEAR(found.ball_height_m[0], kWalkerBallHeightM, 0.003);
  EXPECT_EQ(found.skeleton.joints[1].offset_m, target.joints[1].offset_m);
}

}  // namespace
}  // namespace stridewire
