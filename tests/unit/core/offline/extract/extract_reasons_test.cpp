// Every capture that yields no step and no jump gets a reason that a user can act on.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "capture_files.h"
#include "offline/extract/extract.h"
#include "synthetic_walker.h"

namespace stridewire {
namespace {

using ::testing::HasSubstr;

// Returns all reasons of a capture in one text.
std::string Reasons(const Extraction& found) {
  std::string all = found.no_movement_reason;
  for (const RejectedTime& time : found.rejected) all += "\n" + time.reason;
  return all;
}

std::string ReasonsForNothing(const Capture& capture) {
  const Extraction found = Extract(capture);
  EXPECT_EQ(found.error, "");
  EXPECT_EQ(found.steps_left + found.steps_right + found.jumps, 0);
  return Reasons(found);
}

const std::vector<WalkerStep> kWalk = {
    {Foot::kLeft, 0.5}, {Foot::kRight, 0.5}, {Foot::kLeft, 0.5}, {Foot::kRight, 0.0}};

TEST(ExtractReasons, SingleFrame) {
  Capture capture = SyntheticWalker().Walk(kWalk);
  capture.clip.Resize(1, capture.clip.joint_count);
  EXPECT_THAT(ReasonsForNothing(capture), HasSubstr("only one usable frame"));
}

TEST(ExtractReasons, ShortCapture) {
  SyntheticWalker walker;
  walker.stand_s = 0.0;
  Capture capture = walker.Walk(kWalk);
  capture.clip.Resize(40, capture.clip.joint_count);
  EXPECT_THAT(ReasonsForNothing(capture), HasSubstr("lasts only 0.33 s"));
}

TEST(ExtractReasons, SlowMotion) {
  Capture capture = SyntheticWalker().Walk(kWalk);
  ASSERT_EQ(capture.clip.fps, 120.0);
  capture.clip.fps = 12.0;
  const Extraction slow = Extract(capture);
  EXPECT_EQ(slow.steps_left + slow.steps_right + slow.jumps, 0) << slow.error;
  std::string all = Reasons(slow);
  for (const std::string& note : slow.notes) all += "\n" + note;
  EXPECT_THAT(all, HasSubstr("at 120 frames per second there would be 2 left and 2 right steps"));
  EXPECT_THAT(all, HasSubstr("try --fps 120"));
}

TEST(ExtractReasons, NothingMoves) {
  EXPECT_THAT(ReasonsForNothing(SyntheticWalker().Stand(3.0)), HasSubstr("nothing moves"));
}

TEST(ExtractReasons, FeetNeverLeaveTheFloor) {
  const SyntheticWalker walker;
  Capture capture = walker.Jump(0.5);
  // The figure only crouches.
  capture.clip.Resize(static_cast<int>((walker.truth.toe_off_s[0] - 0.2) * walker.fps),
                      capture.clip.joint_count);
  EXPECT_THAT(ReasonsForNothing(capture), HasSubstr("the feet never leave the floor"));
}

TEST(ExtractReasons, Lying) {
  Capture capture = SyntheticWalker().Walk(kWalk);
  const Quat back(std::sqrt(0.5f), -std::sqrt(0.5f), 0.0f, 0.0f);
  for (int f = 0; f < capture.clip.frame_count(); ++f) {
    const PoseSpan pose = capture.clip.frame(f);
    pose.root_position_m.y = 0.15f;
    pose.rotations[0] = back * pose.rotations[0];
  }
  const std::string reasons = ReasonsForNothing(capture);
  EXPECT_THAT(reasons, HasSubstr("the figure lies or crawls"));
  EXPECT_THAT(reasons, HasSubstr("--up"));
}

TEST(ExtractReasons, RunsAreCalledRuns) {
  for (const double fps : {30.0, 60.0, 120.0}) {
    SyntheticWalker walker;
    walker.fps = fps;
    const std::string reasons = ReasonsForNothing(walker.Run(8));
    EXPECT_THAT(reasons, HasSubstr("this is a run (both feet off the ground for about ")) << fps;
    EXPECT_THAT(reasons, HasSubstr("not supported")) << fps;
    EXPECT_THAT(reasons, ::testing::Not(HasSubstr("holds"))) << fps;
  }
}

// The message names the frame rate at which the fall would be that of gravity.
TEST(ExtractReasons, WrongFrameRatesAreMeasured) {
  for (const auto& [factor, rate] : {std::pair{0.25, "set --fps 120"},
                                     {0.5, "set --fps 120"},
                                     {1.4, "set --fps 120"},
                                     {2.0, "set --fps 120"}}) {
    SCOPED_TRACE(factor);
    Capture capture = SyntheticWalker().Jump(0.5);
    capture.clip.fps *= factor;
    const std::string reasons = ReasonsForNothing(capture);
    EXPECT_THAT(reasons, HasSubstr("falls at about"));
    EXPECT_THAT(reasons, HasSubstr(rate));
    EXPECT_THAT(reasons, ::testing::Not(HasSubstr("holds")));
  }
}

TEST(ExtractReasons, CapturedRunsAreCalledRuns) {
  const std::vector<std::filesystem::path> files = MocapFiles("gaits/09");
  STRIDEWIRE_SKIP_WITHOUT(files);
  for (const std::filesystem::path& file : files) {
    const Expected<Capture> capture = ReadBvh(file);
    ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
    EXPECT_THAT(ReasonsForNothing(*capture), HasSubstr("this is a run")) << file;
  }
}

}  // namespace
}  // namespace stridewire
