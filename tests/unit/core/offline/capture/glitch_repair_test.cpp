#include "offline/capture/glitch_repair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "synthetic_walker.h"

namespace stridewire {
namespace {

// A walking figure with smooth motion, and one of its joints.
struct Figure {
  Capture capture = SyntheticWalker{}.Walk({{Foot::kLeft, 0.5}, {Foot::kRight, 0.6}});
  int joint = 0;

  explicit Figure(const char* name) : joint(capture.skeleton.FindJoint(name)) {}
  Quat& At(int frame) {
    return capture.clip.frame(frame).rotations[static_cast<std::size_t>(joint)];
  }
  GlitchReport Repair() {
    return RepairGlitches(capture.skeleton, capture.first_frame, capture.clip);
  }
};

TEST(RepairGlitches, KeepsSmoothMotion) {
  Figure figure("LeftLeg");
  const Clip before = figure.capture.clip;
  const GlitchReport report = figure.Repair();
  EXPECT_TRUE(report.repaired.empty());
  EXPECT_TRUE(report.left.empty());
  EXPECT_TRUE(before.rotations == figure.capture.clip.rotations);
}

TEST(RepairGlitches, InterpolatesOverShortFlips) {
  for (const int bad : {1, 2, 3}) {
    Figure figure("LeftLeg");
    const Clip truth = figure.capture.clip;
    for (int f = 100; f < 100 + bad; ++f) figure.At(f) = figure.At(f) * YawRotation(1.2);
    const GlitchReport report = figure.Repair();
    ASSERT_EQ(report.repaired.size(), 1u) << bad;
    EXPECT_EQ(report.repaired[0].joint, figure.joint);
    EXPECT_EQ(report.repaired[0].frames, (FrameRange{100, 100 + bad}));
    EXPECT_NEAR(report.repaired[0].angle_rad, 1.2, 0.1);
    EXPECT_TRUE(report.left.empty());
    for (int f = 95; f < 110; ++f) {
      EXPECT_LT(LargestJointAngle(truth.frame(f), figure.capture.clip.frame(f)), 0.02) << f;
    }
  }
}

TEST(RepairGlitches, ReplacesBadFramesAtTheEnds) {
  Figure figure("LeftArm");
  const int end = figure.capture.clip.frame_count();
  for (const int f : {0, 1, end - 1}) figure.At(f) = YawRotation(1.6);
  const GlitchReport report = figure.Repair();
  EXPECT_EQ(report.repaired.size(), 2u);
  EXPECT_TRUE(report.left.empty());
  for (int f = 0; f < end; ++f) EXPECT_LT(AngleBetween(figure.At(f), kIdentityQuat), 1e-3) << f;
}

TEST(RepairGlitches, IgnoresFramesBeforeTheFirst) {
  Figure figure("LeftArm");
  figure.capture.first_frame = 1;
  figure.At(0) = YawRotation(1.6);  // Like the artificial T-pose of a recording.
  EXPECT_TRUE(figure.Repair().repaired.empty());
  EXPECT_NEAR(AngleBetween(figure.At(0), YawRotation(1.6)), 0.0, 1e-3);
}

TEST(RepairGlitches, SpreadsSmallLastingJumps) {
  Figure figure("LeftArm");
  for (int f = 100; f < figure.capture.clip.frame_count(); ++f) figure.At(f) = YawRotation(0.6);
  const GlitchReport report = figure.Repair();
  EXPECT_EQ(report.repaired.size(), 1u);
  EXPECT_TRUE(report.left.empty());
  for (int f = 90; f < 110; ++f) {
    EXPECT_LT(AngleBetween(figure.At(f), figure.At(f + 1)), 0.1) << f;
  }
  EXPECT_LT(AngleBetween(figure.At(90), kIdentityQuat), 1e-3);
  EXPECT_LT(AngleBetween(figure.At(110), YawRotation(0.6)), 1e-3);
}

TEST(RepairGlitches, SpreadsLargeJumpsOfLimbEnds) {
  Figure figure("LeftToeBase");
  for (int f = 100; f < figure.capture.clip.frame_count(); ++f) figure.At(f) = YawRotation(2.5);
  const GlitchReport report = figure.Repair();
  EXPECT_EQ(report.repaired.size(), 1u);
  EXPECT_TRUE(report.left.empty());
}

TEST(RepairGlitches, ReportsLargeLastingJumps) {
  Figure figure("LeftArm");  // The arm below it is 60 cm long.
  for (int f = 100; f < figure.capture.clip.frame_count(); ++f) figure.At(f) = YawRotation(1.6);
  const GlitchReport report = figure.Repair();
  EXPECT_TRUE(report.repaired.empty());
  ASSERT_EQ(report.left.size(), 1u);
  EXPECT_EQ(DescribeFlip(figure.capture.skeleton, report.left[0], 120.0),
            "LeftArm turns 92 degrees in one frame at 0.83 s");
}

TEST(RepairGlitches, RepairsThePathOfTheRoot) {
  for (const int bad : {1, 2}) {
    Figure figure("Hips");
    const std::vector<Vec3> truth = figure.capture.clip.root_positions_m;
    for (int f = 100; f < 100 + bad; ++f) {
      figure.capture.clip.root_positions_m[static_cast<std::size_t>(f)] += Vec3(0.03f, 0.0f, 0.02f);
    }
    const GlitchReport report = figure.Repair();
    ASSERT_EQ(report.repaired.size(), 1u) << bad;
    EXPECT_EQ(report.repaired[0].frames, (FrameRange{100, 100 + bad}));
    EXPECT_NEAR(report.repaired[0].distance_m, 0.036, 0.01);
    for (std::size_t f = 0; f < truth.size(); ++f) {
      EXPECT_LT(glm::length(truth[f] - figure.capture.clip.root_positions_m[f]), 0.002f) << f;
    }
    EXPECT_THAT(DescribeRepairs(figure.capture.skeleton, report, 120.0),
                ::testing::ElementsAre(::testing::HasSubstr("Hips moves 3")));
  }
}

TEST(RepairGlitches, DescribesEachJointOnce) {
  Figure figure("LeftLeg");
  for (const int f : {60, 90, 130}) figure.At(f) = figure.At(f) * YawRotation(f == 90 ? 1.2 : 0.8);
  const GlitchReport report = figure.Repair();
  EXPECT_EQ(report.repaired.size(), 3u);
  const std::vector<std::string> sentences =
      DescribeRepairs(figure.capture.skeleton, report, figure.capture.clip.fps);
  ASSERT_EQ(sentences.size(), 1u);
  EXPECT_THAT(sentences[0], ::testing::AllOf(::testing::StartsWith("LeftLeg turns 6"),
                                             ::testing::HasSubstr("0.75 s"),
                                             ::testing::EndsWith("with 2 smaller flips")));
}

}  // namespace
}  // namespace stridewire
