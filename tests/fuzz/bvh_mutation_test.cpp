// Reads mutated BVH files. Each must give a capture or an error that names the file.
// STRIDEWIRE_FUZZ_COUNT sets their number (default 2000), STRIDEWIRE_FUZZ_SEED repeats a run.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "bvh_text.h"
#include "stridewire/offline/bvh_reader.h"

namespace stridewire {
namespace {

using test::BvhText;

std::vector<std::string> Seeds() {
  std::vector<std::string> seeds;
  BvhText text;
  seeds.push_back(text.Text());
  text.line_end = "\r\n";
  text.toes = false;
  text.frames = 3;
  seeds.push_back(text.Text());
  text = {};
  text.names = false;
  text.axes = {1, 3, -2};
  text.unit = 100.0;
  seeds.push_back(text.Text());
  text = {};
  text.positions_everywhere = true;
  text.frames = 4;
  seeds.push_back(text.Text());
  text = {};
  text.folded = true;
  text.end_sites = false;
  text.last_line_end = false;
  seeds.push_back(text.Text());
  std::vector<std::filesystem::path> captures = test::SharedCaptures();
  for (const std::filesystem::path& path : test::PackagedCaptures()) captures.push_back(path);
  std::sort(captures.begin(), captures.end());
  for (const std::filesystem::path& path : captures) {
    // Uses the header and the first few rows.
    const std::string whole = test::FileText(path);
    std::size_t end = whole.find("Frame Time");
    for (int line = 0; line < 8 && end != std::string::npos; ++line)
      end = whole.find('\n', end + 1);
    seeds.push_back(whole.substr(0, end));
  }
  return seeds;
}

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  std::string Mutate(std::string text) {
    const std::size_t mutations = Below(2) == 0 ? 1 : 1 + Below(4);
    for (std::size_t i = 0; i < mutations && !text.empty(); ++i) One(text);
    return text;
  }

  std::size_t Below(std::size_t n) { return n == 0 ? 0 : static_cast<std::size_t>(random_() % n); }

 private:
  // Returns [begin, end) of the line or word at a random position.
  std::pair<std::size_t, std::size_t> RandomPart(const std::string& text, const char* separators) {
    const std::size_t at = Below(text.size());
    const std::size_t before = at == 0 ? std::string::npos : text.find_last_of(separators, at - 1);
    const std::size_t begin = before == std::string::npos ? 0 : before + 1;
    const std::size_t end = std::min(text.find_first_of(separators, at), text.size());
    return {begin, std::max(begin, end)};
  }

  void One(std::string& text) {
    static const char* const kWords[] = {"1e999",      "-1e999",
                                         "nan",        "inf",
                                         "1e-999",     "99999999999",
                                         "-1",         "0",
                                         "1e7",        "-9999999",
                                         "0x10",       "1.7976931348623157e308",
                                         "4.9e-324",   "18446744073709551616",
                                         "2147483648", "{",
                                         "}",          "ROOT",
                                         "JOINT",      "OFFSET",
                                         "CHANNELS",   "End",
                                         "MOTION",     "Frames:",
                                         "",           "Xrotation",
                                         "Yposition",  "\t\t",
                                         ".",          "-",
                                         "+",          "1e",
                                         "HIERARCHY",  "180",
                                         "90",         "6",
                                         "3"};
    switch (Below(10)) {
      case 0: text[Below(text.size())] = static_cast<char>(random_()); break;
      case 1: text[Below(text.size())] ^= static_cast<char>(1u << Below(8)); break;
      case 2: text.resize(Below(text.size())); break;
      case 3: {  // Deletes a line.
        const auto [begin, end] = RandomPart(text, "\r\n");
        text.erase(begin, end - begin + 1);
        break;
      }
      case 4: {  // Repeats a line once or many times.
        const auto [begin, end] = RandomPart(text, "\r\n");
        const std::string line = text.substr(begin, end - begin) + "\n";
        const std::size_t times = Below(20) == 0 ? 300 : 1;
        std::string copies;
        for (std::size_t i = 0; i < times; ++i) copies += line;
        text.insert(begin, copies);
        break;
      }
      case 5:
      case 6: {  // Replaces a word.
        const auto [begin, end] = RandomPart(text, " \t\r\n");
        text.replace(begin, end - begin, kWords[Below(std::size(kWords))]);
        break;
      }
      case 7: {  // Replaces a word by a random number.
        const auto [begin, end] = RandomPart(text, " \t\r\n");
        const double digits = static_cast<double>(random_()) / 1e19 * 2 - 1;
        text.replace(begin, end - begin,
                     std::to_string(digits * std::pow(10.0, static_cast<double>(Below(14)) - 4)));
        break;
      }
      case 8: {  // Moves a part of the text.
        const std::size_t begin = Below(text.size());
        const std::string piece = text.substr(begin, Below(400));
        text.erase(begin, piece.size());
        text.insert(Below(text.size() + 1), piece);
        break;
      }
      default: {  // Inserts random bytes.
        std::string bytes(1 + Below(8), '\0');
        for (char& c : bytes) c = static_cast<char>(random_());
        text.insert(Below(text.size() + 1), bytes);
      }
    }
  }

  std::mt19937_64 random_;
};

TEST(BvhMutation, GivesACaptureOrAnErrorThatNamesTheFile) {
  const char* count_text = std::getenv("STRIDEWIRE_FUZZ_COUNT");
  const char* seed_text = std::getenv("STRIDEWIRE_FUZZ_SEED");
  const std::uint64_t count = count_text != nullptr ? std::strtoull(count_text, nullptr, 10) : 2000;
  const std::uint64_t seed =
      seed_text != nullptr ? std::strtoull(seed_text, nullptr, 10) : std::random_device{}();
  std::cout << "seed " << seed << ", " << count << " files\n";
  const std::vector<std::string> seeds = Seeds();
  for (const std::string& text : seeds) ASSERT_TRUE(ParseBvh(text, "seed.bvh").has_value());

  Mutator mutator(seed);
  std::uint64_t parsed = 0;
  std::uint64_t rejected = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string text = mutator.Mutate(seeds[mutator.Below(seeds.size())]);
    SCOPED_TRACE(testing::Message() << "seed " << seed << ", file " << i);
    const Expected<Capture> capture = ParseBvh(text, "mutated.bvh");
    if (!capture) {
      ++rejected;
      const Error& error = capture.error();
      const bool names_file =
          error.where == "mutated.bvh" || error.where.starts_with("mutated.bvh:");
      ASSERT_TRUE(names_file) << Describe(error);
      ASSERT_GT(std::string_view(error.text).size(), 5u);
      ASSERT_LT(Describe(error).size(), 300u);
      continue;
    }
    ++parsed;
    ASSERT_TRUE(capture->skeleton.Validate().has_value());
    ASSERT_TRUE(capture->clip.Validate().has_value());
    ASSERT_GE(capture->first_frame, 0);
    ASSERT_LT(capture->first_frame, capture->clip.frame_count());
    ASSERT_GT(capture->unit_m, 0.0);
    // Memory is bounded by the size of the text: a frame takes a line of at least two characters.
    ASSERT_LE(static_cast<std::size_t>(capture->clip.frame_count()) * 2, text.size() + 2);
    ASSERT_LE(capture->clip.rotations.capacity(), capture->clip.rotations.size() * 2 + 64);
    std::size_t note_bytes = 0;
    for (const std::string& note : capture->notes) note_bytes += note.size();
    ASSERT_LT(note_bytes, 200'000u);
  }
  std::cout << parsed << " parsed, " << rejected << " rejected\n";
  // The test is meaningful only if mutations break some files and not others.
  if (count >= 500) {
    EXPECT_GT(parsed, count / 20);
    EXPECT_GT(rejected, count / 20);
  }
}

}  // namespace
}  // namespace stridewire
