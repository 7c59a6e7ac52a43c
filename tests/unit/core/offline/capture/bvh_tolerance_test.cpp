// Deviations from the BVH format that the reader accepts as other programs do.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "bvh_text.h"
#include "stridewire/offline/bvh_reader.h"

namespace stridewire {
namespace {

using test::BvhText;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

Capture Read(const std::string& text, const BvhReadOptions& options = {}) {
  Expected<Capture> capture = ParseBvh(text, "figure.bvh", options);
  EXPECT_TRUE(capture.has_value()) << (capture ? "" : Describe(capture.error()));
  return capture ? std::move(*capture) : Capture{};
}

std::string ErrorOf(const std::string& text) {
  const Expected<Capture> capture = ParseBvh(text, "figure.bvh");
  return capture ? "none" : Describe(capture.error());
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string ReplacedAll(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

void ExpectSameMotion(const Capture& a, const Capture& b) {
  EXPECT_EQ(a.clip.rotations, b.clip.rotations);
  EXPECT_EQ(a.clip.root_positions_m, b.clip.root_positions_m);
  EXPECT_EQ(a.clip.fps, b.clip.fps);
  ASSERT_EQ(a.skeleton.joints.size(), b.skeleton.joints.size());
  for (std::size_t j = 0; j < a.skeleton.joints.size(); ++j) {
    EXPECT_EQ(a.skeleton.joints[j].name, b.skeleton.joints[j].name);
    EXPECT_EQ(a.skeleton.joints[j].offset_m, b.skeleton.joints[j].offset_m);
  }
}

TEST(BvhTolerance, ReadsDecimalCommas) {
  const std::string plain = BvhText().Text();
  const Capture capture = Read(ReplacedAll(plain, ".", ","));
  ExpectSameMotion(capture, Read(plain));
  EXPECT_THAT(capture.notes, Contains(HasSubstr("commas in numbers are read as decimal points")));
}

TEST(BvhTolerance, RefusesCommasBesidePoints) {
  const std::string plain = BvhText().Text();
  EXPECT_THAT(ErrorOf(Replaced(plain, "0.0333333", "0,0333333")),
              HasSubstr("mixes commas and points"));
  // The first number with a point follows those with commas.
  std::string commas = ReplacedAll(plain, ".", ",");
  commas = Replaced(commas, "0,0333333", "0.0333333");
  EXPECT_THAT(ErrorOf(commas), HasSubstr("mixes commas and points"));
  EXPECT_THAT(ErrorOf(Replaced(commas, "0,0000000", "0,000,000")), HasSubstr("three numbers"));
}

TEST(BvhTolerance, CountsTheFramesItself) {
  const Capture plain = Read(BvhText().Text());
  BvhText text;
  for (const char* written : {"0", "0.0"}) {
    text.frames_text = written;
    const Capture zero = Read(text.Text());
    ExpectSameMotion(zero, plain);
    EXPECT_THAT(zero.notes, Contains(HasSubstr("declares 0 frames, but the file contains 12")));
  }
  text.frames_text = "12.0";
  const Capture decimal = Read(text.Text());
  ExpectSameMotion(decimal, plain);
  EXPECT_THAT(decimal.notes, Contains(HasSubstr("written as 12.0, not as an integer")));
  text.frames_text = "11.5";
  EXPECT_THAT(ErrorOf(text.Text()), HasSubstr("expected an integer"));
  text.frames = 0;
  text.frames_text = "0";
  EXPECT_THAT(ErrorOf(text.Text()), HasSubstr("expected at least one frame"));
}

TEST(BvhTolerance, SkipsComments) {
  const std::string plain = BvhText().Text();
  std::string text = "# exported by hand\n// second line\n\n" + plain;
  text = Replaced(text, "MOTION\n", "# the motion\nMOTION // here\n");
  text = Replaced(text, "Frame Time: 0.0333333\n", "Frame Time: 0.0333333 # 30 Hz\n# row 1\n");
  text += "# end\n";
  ExpectSameMotion(Read(text), Read(plain));
  // A joint name may begin with #.
  const Capture named = Read(Replaced(plain, "JOINT Head", "JOINT #Head"));
  EXPECT_GE(named.skeleton.FindJoint("#Head"), 0);
}

TEST(BvhTolerance, ReadsRowsThatContinueOnFurtherLines) {
  const std::string plain = BvhText().Text();
  const std::size_t rows = plain.find('\n', plain.find("Frame Time")) + 1;
  std::string text = plain.substr(0, rows);
  int spaces = 0;
  for (const char c : plain.substr(rows)) {
    text += c == ' ' && ++spaces % 10 == 0 ? '\n' : c;
    if (c == '\n') spaces = 0;
  }
  const Capture capture = Read(text);
  ExpectSameMotion(capture, Read(plain));
  EXPECT_THAT(capture.notes, Contains(HasSubstr("as in 11 more frames")));
  // Additional or missing numbers are still detected.
  EXPECT_THAT(ErrorOf(plain.substr(0, rows) + "1 2 3\n" + plain.substr(rows)),
              HasSubstr("fewer numbers"));
}

TEST(BvhTolerance, LeavesOutATruncatedLastRow) {
  std::string text = BvhText().Text();
  text.resize(text.size() - 60);
  const Capture capture = Read(text);
  EXPECT_EQ(capture.clip.frame_count(), 11);
  EXPECT_THAT(capture.notes, Contains(HasSubstr("the last frame is incomplete")));
  BvhText one;
  one.frames = 1;
  std::string single = one.Text();
  single.resize(single.size() - 60);
  EXPECT_THAT(ErrorOf(single), HasSubstr("fewer numbers than channels"));
}

TEST(BvhTolerance, IgnoresScaleChannels) {
  const std::string plain = BvhText().Text();
  std::string text =
      Replaced(plain, "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",
               "CHANNELS 9 Xposition Yposition Zposition Zrotation Xrotation Yrotation Xscale "
               "Yscale Zscale");
  // The numbers of the root are the first six of a row.
  std::size_t at = text.find('\n', text.find("Frame Time")) + 1;
  while (at < text.size()) {
    for (int number = 0; number < 6; ++number) at = text.find(' ', at + 1);
    text.insert(at, " 1 1.5 1");
    at = text.find('\n', at) + 1;
  }
  const Capture capture = Read(text);
  ExpectSameMotion(capture, Read(plain));
  EXPECT_THAT(capture.notes, Contains(HasSubstr("scale channels of 1 joint are ignored")));
}

TEST(BvhTolerance, NeedsAFrameRateWithoutFrameTime) {
  const std::string plain = BvhText().Text();
  const std::string without = Replaced(plain, "Frame Time: 0.0333333\n", "");
  EXPECT_THAT(ErrorOf(without), HasSubstr("the option fps"));
  const std::string zero = Replaced(plain, "0.0333333", "0");
  EXPECT_THAT(ErrorOf(zero), HasSubstr("the option fps"));
  BvhReadOptions options;
  options.fps = 30.0;
  for (const std::string& text : {without, zero}) {
    ExpectSameMotion(Read(text, options), Read(plain, options));
  }
}

TEST(BvhTolerance, NotesNamesThatAreNotUtf8) {
  const std::string text = Replaced(BvhText().Text(), "JOINT Head",
                                    "JOINT K\xF6"
                                    "pf");
  const Capture capture = Read(text);
  EXPECT_GE(capture.skeleton.FindJoint("K_pf"), 0);
  EXPECT_THAT(capture.notes, Contains(HasSubstr("not UTF-8")));
  EXPECT_THAT(Read(BvhText().Text()).notes, Not(Contains(HasSubstr("not UTF-8"))));
}

TEST(BvhTolerance, NamesTheEncodingOfUtf16Files) {
  EXPECT_THAT(ErrorOf(std::string("\xFF\xFEH\0I\0", 6)), HasSubstr("UTF-16"));
}

}  // namespace
}  // namespace stridewire
