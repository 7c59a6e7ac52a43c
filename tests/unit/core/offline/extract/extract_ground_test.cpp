// Steps on ground that is not one level floor, and figures whose root or first frames are unusual.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "offline/extract/assemble.h"
#include "offline/extract/extract.h"
#include "stridewire/runtime/pose.h"
#include "synthetic_walker.h"

namespace stridewire {
namespace {

using ::testing::HasSubstr;

std::vector<WalkerStep> WalkWithRise(double rise_m) {
  return {{Foot::kLeft, 0.5},       {Foot::kRight, 0.5}, {Foot::kLeft, 0.5, rise_m},
          {Foot::kRight, 0.5, 0.0}, {Foot::kLeft, 0.5},  {Foot::kRight, 0.0}};
}

double SoleHeight(const Extraction& found, const RawExample& example, Foot foot) {
  return BallPosition(found.skeleton, example.clip.frame(0), foot).y -
         found.ball_height_m[static_cast<int>(foot)];
}

TEST(ExtractGround, FindsAllStepsOverKerbsOfAnyHeight) {
  for (const double rise :
       {0.02, 0.05, 0.06, 0.07, 0.08, 0.09, 0.099, 0.1, 0.12, 0.18, -0.05, -0.08, -0.099, -0.15}) {
    SCOPED_TRACE(rise);
    const Extraction found = Extract(SyntheticWalker().Walk(WalkWithRise(rise)));
    EXPECT_EQ(found.steps_left, 3);
    EXPECT_EQ(found.steps_right, 3);
    ASSERT_EQ(found.general_steps.size(), 6u);
    for (const ExtractedExample& step : found.general_steps) {
      // The fixed foot stands on the ground, before, on and behind the kerb.
      EXPECT_NEAR(SoleHeight(found, step.example, OtherFoot(MovingFoot(step.kind))), 0.0, 0.005);
    }
    EXPECT_NEAR(found.general_steps[2].example.parameters[4], rise, 0.01);
    if (rise != 0.05 && rise != -0.05) {  // The limit of level steps.
      EXPECT_EQ(found.general_steps[2].level, std::fabs(rise) < 0.05);
    }
    EXPECT_TRUE(found.general_steps[0].level);
    EXPECT_TRUE(found.general_steps[5].level);
    // Levels that differ by less than 3 cm are not distinguished.
    EXPECT_NEAR(found.ball_height_m[0], kWalkerBallHeightM, std::fabs(rise) < 0.03 ? 0.011 : 0.003);
  }
}

TEST(ExtractGround, FindsAllStepsOnAnInclinedFloor) {
  for (const double slope : {0.01, -0.01, 0.03, -0.03}) {
    SCOPED_TRACE(slope);
    SyntheticWalker walker;
    walker.slope = slope;
    std::vector<WalkerStep> steps;
    for (int i = 0; i < 20; ++i) steps.push_back({i % 2 == 0 ? Foot::kLeft : Foot::kRight, 0.5});
    const Extraction found = Extract(walker.Walk(steps));
    EXPECT_EQ(found.steps_left, 10);
    EXPECT_EQ(found.steps_right, 10);
    ASSERT_EQ(found.general_steps.size(), 20u);
    for (const ExtractedExample& step : found.general_steps) {
      EXPECT_TRUE(step.level) << step.example.source;
      EXPECT_NEAR(SoleHeight(found, step.example, OtherFoot(MovingFoot(step.kind))), 0.0, 0.006);
    }
    EXPECT_NEAR(found.ball_height_m[0] - found.ball_height_m[1], 0.0, 0.003);
  }
}

// The floor rises under the walker, but the examples of a library stand on level ground.
TEST(ExtractGround, ExamplesOfAnInclinedFloorStandOnLevelGround) {
  SyntheticWalker walker;
  walker.slope = 0.03;
  std::vector<WalkerStep> steps;
  for (int i = 0; i < 20; ++i) steps.push_back({i % 2 == 0 ? Foot::kLeft : Foot::kRight, 0.5});
  for (const bool mirror : {false, true}) {
    SCOPED_TRACE(mirror);
    LibraryAssembler assembler({.mirror = mirror});
    const Extraction& found = assembler.Add(walker.Walk(steps));
    const auto sole = [&](const RawExample& example, int frame, Foot foot) {
      return BallPosition(found.skeleton, example.clip.frame(frame), foot).y -
             found.ball_height_m[static_cast<int>(foot)];
    };
    const auto library = assembler.Assemble();
    ASSERT_TRUE(library.has_value()) << library.error().text;
    int examples = 0;
    for (const RawGroup& group : library->groups) {
      for (const RawExample& example : group.examples) {
        ++examples;
        for (const int frame : {0, example.clip.frame_count() - 1}) {
          EXPECT_NEAR(sole(example, frame, Foot::kLeft), sole(example, frame, Foot::kRight), 0.006)
              << example.source << ", frame " << frame;
        }
      }
    }
    EXPECT_GE(examples, mirror ? 40 : 20);
  }
}

// In a capture with level steps and a climb of 80 cm, the fixed foot of every step is on the
// ground.
TEST(ExtractGround, LevelStepsStayOnTheGroundBesideAClimb) {
  std::vector<WalkerStep> steps;
  for (int i = 0; i < 16; ++i) {
    const double rise = i >= 6 && i < 10 ? 0.2 : 0.0;
    steps.push_back({i % 2 == 0 ? Foot::kLeft : Foot::kRight, 0.4, rise});
  }
  const Extraction found = Extract(SyntheticWalker().Walk(steps));
  ASSERT_EQ(found.general_steps.size(), 16u);
  for (const ExtractedExample& step : found.general_steps) {
    EXPECT_NEAR(SoleHeight(found, step.example, OtherFoot(MovingFoot(step.kind))), 0.0, 0.005)
        << step.example.source;
  }
  EXPECT_GE(found.straight_steps.size(), 10u);
}

TEST(ExtractGround, LeavesOutAStillPoseThatJumpsToTheMotion) {
  for (const double lower : {-0.1, 0.0, 0.07, 0.3}) {
    SCOPED_TRACE(lower);
    Capture capture = SyntheticWalker().Walk(WalkWithRise(0.0));
    PrependStillPose(60, lower, capture);
    // The arms are raised in the motion, so the pose changes even if the feet stay.
    for (int f = 60; f < capture.clip.frame_count(); ++f) {
      capture.clip.frame(f).rotations.back() = Quat(0.7071068f, 0.7071068f, 0.0f, 0.0f);
      capture.clip.frame(f).rotations[9] = Quat(0.7071068f, 0.0f, 0.0f, 0.7071068f);
    }
    const Extraction found = Extract(capture);
    EXPECT_EQ(found.steps_left, 3);
    EXPECT_EQ(found.steps_right, 3);
    EXPECT_THAT(found.notes, ::testing::Contains(HasSubstr("the first 60 frames (0.50 s)")));
    double from = 0.0;
    ASSERT_EQ(
        std::sscanf(found.general_steps[0].example.source.c_str(), "synthetic.bvh %lf-", &from), 1);
    EXPECT_GE(from, 0.5) << "the still pose is part of a step";
  }
}

// A figure that starts 20 cm too low and then rises to the height of the motion does not hang.
TEST(ExtractGround, FindsAllStepsAfterABlendedStart) {
  Capture capture = SyntheticWalker().Walk(WalkWithRise(0.0));
  for (int f = 0; f < 48; ++f) {
    const double u = std::clamp((f - 30) / 18.0, 0.0, 1.0);
    capture.clip.root_positions_m[static_cast<std::size_t>(f)].y -=
        static_cast<float>(0.2 * (1.0 - u));
  }
  const Extraction found = Extract(capture);
  EXPECT_EQ(found.steps_left, 3);
  EXPECT_EQ(found.steps_right, 3);
  for (const RejectedTime& time : found.rejected) {
    EXPECT_THAT(time.reason, ::testing::Not(HasSubstr("holds")));
  }
}

TEST(ExtractGround, KeepsAFigureThatStandsStillBeforeItMoves) {
  const Extraction found = Extract(SyntheticWalker().Walk(WalkWithRise(0.0)));
  EXPECT_THAT(found.notes, ::testing::Not(::testing::Contains(HasSubstr("still pose"))));
  EXPECT_EQ(found.steps_left + found.steps_right, 6);
}

TEST(ExtractGround, RejectsAWalkOnTheSpotWithAdvice) {
  for (const double fps : {30.0, 60.0, 120.0}) {
    SyntheticWalker walker;
    walker.fps = fps;
    Capture capture = walker.Walk(WalkWithRise(0.0));
    RemoveTravel(capture);
    const Extraction found = Extract(capture);
    EXPECT_EQ(found.steps_left + found.steps_right + found.jumps, 0);
    ASSERT_EQ(found.rejected.size(), 1u);
    EXPECT_THAT(found.rejected[0].reason, HasSubstr("walks on the spot"));
    EXPECT_THAT(found.rejected[0].reason, HasSubstr("--root-motion"));
  }
}

TEST(ExtractGround, DerivesRootMotionFromTheStandingFoot) {
  for (const double fps : {30.0, 60.0, 120.0}) {
    SCOPED_TRACE(fps);
    SyntheticWalker walker;
    walker.fps = fps;
    const Capture whole = walker.Walk(WalkWithRise(0.0));
    Capture capture = whole;
    RemoveTravel(capture);
    ExtractOptions options;
    options.derive_root_motion = true;
    const Extraction found = Extract(capture, options);
    const Extraction expected = Extract(whole);
    EXPECT_EQ(found.steps_left, 3);
    EXPECT_EQ(found.steps_right, 3);
    EXPECT_THAT(found.notes, ::testing::Contains(HasSubstr("root motion of")));
    ASSERT_EQ(found.general_steps.size(), expected.general_steps.size());
    for (std::size_t i = 0; i < found.general_steps.size(); ++i) {
      for (std::size_t p = 0; p < 7; ++p) {
        EXPECT_NEAR(found.general_steps[i].example.parameters[p],
                    expected.general_steps[i].example.parameters[p], 0.03)
            << i << " " << p;
      }
    }
    // A capture that travels is not changed.
    EXPECT_EQ(Extract(whole, options).general_steps[1].example.parameters,
              expected.general_steps[1].example.parameters);
  }
}

// Figures that step or jump without travelling do not slide their feet.
TEST(ExtractGround, StepsAndJumpsInPlaceAreNotWalksOnTheSpot) {
  const std::vector<WalkerStep> small = {{Foot::kLeft, 0.1},  {Foot::kRight, 0.0},
                                         {Foot::kLeft, -0.1}, {Foot::kRight, 0.0},
                                         {Foot::kLeft, 0.1},  {Foot::kRight, 0.0}};
  EXPECT_EQ(Extract(SyntheticWalker().Walk(small)).steps_left, 3);
  EXPECT_EQ(Extract(SyntheticWalker().Jump(0.0)).jumps, 1);
}

}  // namespace
}  // namespace stridewire
