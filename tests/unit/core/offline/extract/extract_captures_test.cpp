// Compares extraction from real recordings with an independent analysis, in which the balls were
// measured in the middle of double support.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "capture_files.h"
#include "offline/extract/extract.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

Extraction ExtractFile(const std::filesystem::path& path) {
  const Expected<Capture> capture = ReadBvh(path);
  EXPECT_TRUE(capture.has_value()) << Describe(capture.error());
  return capture ? Extract(*capture) : Extraction{};
}

std::vector<double> JumpLengths(const Extraction& extraction) {
  std::vector<double> lengths;
  for (const ExtractedExample& jump : extraction.jump_examples) {
    lengths.push_back(jump.example.parameters[0]);
  }
  return lengths;
}

TEST(ExtractCaptures, FindsTheTenJumpsOf01_01) {
  const std::filesystem::path file = ModelFile("01_01.bvh");
  STRIDEWIRE_SKIP_WITHOUT(file);
  const Extraction extraction = ExtractFile(file);
  EXPECT_EQ(extraction.jumps, 10);
  using ::testing::DoubleNear;
  EXPECT_THAT(
      JumpLengths(extraction),
      ::testing::ElementsAre(DoubleNear(0.77, 0.04), DoubleNear(0.94, 0.04), DoubleNear(0.90, 0.04),
                             DoubleNear(0.93, 0.04), DoubleNear(0.95, 0.04), DoubleNear(1.06, 0.04),
                             DoubleNear(0.95, 0.04), DoubleNear(0.86, 0.04), DoubleNear(1.10, 0.04),
                             DoubleNear(0.97, 0.04)));
  EXPECT_GE(extraction.steps_left + extraction.steps_right, 3);  // Two turns with small steps.
}

TEST(ExtractCaptures, RejectsHangingIn01_03) {
  const std::filesystem::path file = ModelFile("01_03.bvh");
  STRIDEWIRE_SKIP_WITHOUT(file);
  const Extraction extraction = ExtractFile(file);
  EXPECT_NEAR(extraction.steps_left, 18, 3);
  EXPECT_NEAR(extraction.steps_right, 17, 3);
  EXPECT_GE(extraction.steps_left + extraction.steps_right, 26);
  EXPECT_EQ(extraction.jumps, 0);
  // Around these times the subject hangs on a bar with both feet off the floor.
  for (const double hanging_s : {15.6, 16.4, 33.0, 33.8}) {
    for (const ExtractedExample& step : extraction.general_steps) {
      double from = 0.0;
      double to = 0.0;
      ASSERT_EQ(std::sscanf(step.example.source.c_str(), "01_03.bvh %lf-%lf", &from, &to), 2);
      EXPECT_FALSE(from < hanging_s && hanging_s < to) << step.example.source;
    }
  }
  const auto held = std::ranges::count_if(extraction.rejected, [](const RejectedTime& span) {
    return span.reason.find("not falling") != std::string::npos;
  });
  // Each time, the feet slow down in the air once, which is not a contact.
  EXPECT_EQ(held, 2);
}

TEST(ExtractCaptures, FindsTheStepsAndJumpsOfSubject16) {
  const std::vector<std::filesystem::path> files = MocapFiles("cmu/16");
  STRIDEWIRE_SKIP_WITHOUT(files);
  int left = 0;
  int right = 0;
  std::map<std::string, std::vector<double>> jumps;
  for (const std::filesystem::path& file : files) {
    const Extraction extraction = ExtractFile(file);
    EXPECT_EQ(extraction.error, "");
    left += extraction.steps_left;
    right += extraction.steps_right;
    if (extraction.jumps > 0) jumps[file.stem().string()] = JumpLengths(extraction);
  }
  EXPECT_NEAR(left, 38, 3);
  EXPECT_NEAR(right, 36, 3);
  using ::testing::DoubleNear;
  using ::testing::ElementsAre;
  using ::testing::Pair;
  EXPECT_THAT(jumps, ElementsAre(Pair("16_01", ElementsAre(DoubleNear(-0.03, 0.04))),
                                 Pair("16_05", ElementsAre(DoubleNear(1.07, 0.04))),
                                 Pair("16_06", ElementsAre(DoubleNear(1.24, 0.04))),
                                 Pair("16_09", ElementsAre(DoubleNear(1.86, 0.04))),
                                 Pair("16_10", ElementsAre(DoubleNear(1.97, 0.04)))));
}

struct Counts {
  const char* file;
  int left;
  int right;
};

TEST(ExtractCaptures, AgreesWithAnIndependentAnalysis) {
  const std::vector<std::filesystem::path> files = MocapFiles("cmu/03");
  STRIDEWIRE_SKIP_WITHOUT(files);
  for (const Counts& expected : {Counts{"03/03_01.bvh", 2, 2},
                                 {"03/03_03.bvh", 27, 24},
                                 {"05/05_01.bvh", 4, 3},
                                 {"06/06_08.bvh", 1, 1},
                                 {"09/09_12.bvh", 14, 14},
                                 {"14/14_21.bvh", 4, 4},
                                 {"14/14_22.bvh", 5, 4},
                                 {"29/29_01.bvh", 6, 5},
                                 {"32/32_01.bvh", 2, 2}}) {
    const Extraction extraction = ExtractFile(MocapDir() / "cmu" / expected.file);
    EXPECT_NEAR(extraction.steps_left, expected.left, 1) << expected.file;
    EXPECT_NEAR(extraction.steps_right, expected.right, 1) << expected.file;
    EXPECT_EQ(extraction.jumps, 0) << expected.file;
  }
}

// Straight takes with independently measured initial and final lengths (smallest and largest, m).
TEST(ExtractCaptures, MeasuresTheLengthsOfStraightTakes) {
  struct Range {
    const char* file;
    double start_min, start_max, end_min, end_max;
  };
  STRIDEWIRE_SKIP_WITHOUT(MocapFiles("cmu/16"));
  for (const Range& range : {Range{"16_15", 0.57, 0.63, 0.58, 0.63},
                             {"16_21", 0.75, 0.76, 0.75, 0.76},
                             {"16_32", -0.01, 0.69, 0.60, 0.69},
                             {"16_33", 0.50, 0.66, 0.01, 0.56},
                             {"16_47", 0.65, 0.68, 0.64, 0.68}}) {
    const Extraction extraction =
        ExtractFile(MocapDir() / "cmu/16" / (std::string(range.file) + ".bvh"));
    ASSERT_GE(extraction.straight_steps.size(), 3u) << range.file;
    double start_min = 9.0, start_max = -9.0, end_min = 9.0, end_max = -9.0;
    for (const ExtractedExample& step : extraction.straight_steps) {
      start_min = std::min(start_min, -step.example.parameters[0]);
      start_max = std::max(start_max, -step.example.parameters[0]);
      end_min = std::min(end_min, step.example.parameters[1]);
      end_max = std::max(end_max, step.example.parameters[1]);
    }
    EXPECT_NEAR(start_min, range.start_min, 0.03) << range.file;
    EXPECT_NEAR(start_max, range.start_max, 0.03) << range.file;
    EXPECT_NEAR(end_min, range.end_min, 0.03) << range.file;
    EXPECT_NEAR(end_max, range.end_max, 0.03) << range.file;
  }
}

// The examples must not contain the known flips of single joints.
TEST(ExtractCaptures, RepairsKnownFlips) {
  STRIDEWIRE_SKIP_WITHOUT(MocapFiles("cmu/16"));
  for (const auto& [file, joint, degrees] : {std::tuple{"16_15", "LeftArm", "94"},
                                             {"16_23", "RightArm", "88"},
                                             {"16_17", "Hips", "30"},
                                             {"16_09", "LThumb", "160"}}) {
    const Extraction extraction = ExtractFile(MocapDir() / "cmu/16" / (std::string(file) + ".bvh"));
    EXPECT_THAT(extraction.notes, ::testing::Contains(::testing::StartsWith(std::string(joint) +
                                                                            " turns " + degrees)))
        << file;
    const int j = extraction.skeleton.FindJoint(joint);
    ASSERT_GE(j, 0);
    for (const ExtractedExample& step : extraction.general_steps) {
      const Clip& clip = step.example.clip;
      for (int f = 0; f + 1 < clip.frame_count(); ++f) {
        EXPECT_LT(AngleBetween(clip.frame(f).rotations[static_cast<std::size_t>(j)],
                               clip.frame(f + 1).rotations[static_cast<std::size_t>(j)]),
                  0.4)
            << step.example.source << " frame " << f;
      }
    }
  }
}

// This walker hardly ever stands on both feet.
TEST(ExtractCaptures, KeepsKeytimesApartInShortDoubleSupports) {
  const std::filesystem::path file = MocapDir() / "other/pymo/AV_8Walk_Meredith_HVHA_Rep1.bvh";
  STRIDEWIRE_SKIP_WITHOUT(file);
  const Extraction extraction = ExtractFile(file);
  ASSERT_GE(extraction.general_steps.size(), 12u);
  for (const ExtractedExample& step : extraction.general_steps) {
    const std::vector<double>& times_s = step.example.keytimes_s;
    for (std::size_t i = 0; i + 1 < times_s.size(); ++i) {
      // Keytimes are at frames, 120 per second.
      EXPECT_GE(times_s[i + 1] - times_s[i], 0.02 - 0.5 / 120.0) << step.example.source;
    }
  }
}

TEST(ExtractCaptures, HandlesFilesOfOtherPrograms) {
  STRIDEWIRE_SKIP_WITHOUT(MocapFiles("other/daz"));
  const std::filesystem::path other = MocapDir() / "other";
  const Extraction jump = ExtractFile(other / "daz/13_13.bvh");
  ASSERT_EQ(jump.jumps, 1);
  EXPECT_NEAR(JumpLengths(jump)[0], 1.22, 0.04);
  // The header declares 30 frames per second, but the take has 120. The fall is then too slow.
  const Extraction slow = ExtractFile(other / "amc2bvh/16_02.bvh");
  EXPECT_EQ(slow.jumps, 0);
  ASSERT_EQ(slow.rejected.size(), 1u);
  EXPECT_THAT(slow.rejected[0].reason, ::testing::HasSubstr("120 frames per second"));
  BvhReadOptions options;
  options.fps = 120.0;
  const Expected<Capture> right_speed = ReadBvh(other / "amc2bvh/16_02.bvh", options);
  ASSERT_TRUE(right_speed.has_value());
  EXPECT_EQ(Extract(*right_speed).jumps, 1);
  EXPECT_GE(ExtractFile(other / "animated-drawings/zombie.bvh").straight_steps.size(), 6u);
  EXPECT_GE(ExtractFile(other / "pymo/AV_8Walk_Meredith_HVHA_Rep1.bvh").general_steps.size(), 12u);
  const Extraction feet = ExtractFile(other / "max/131_01.bvh");
  const Extraction metres = ExtractFile(other / "max/scaled_131_01.bvh");
  EXPECT_GE(feet.steps_left, 2);
  EXPECT_EQ(feet.steps_left, metres.steps_left);
  EXPECT_EQ(feet.steps_right, metres.steps_right);
}

}  // namespace
}  // namespace stridewire
