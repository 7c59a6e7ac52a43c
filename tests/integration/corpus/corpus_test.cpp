// Builds libraries from generated BVH files of many rigs and notations, whose movements are known.
//
// STRIDEWIRE_CORPUS_SEED repeats a run or starts another one (default 1). STRIDEWIRE_CORPUS_COUNT
// sets the number of files (default 500). If STRIDEWIRE_CORPUS_DUMP names a folder, the test writes
// every file that fails into it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "corpus/corpus_case.h"
#include "offline/base/text.h"
#include "offline/extract/assemble.h"
#include "offline/inspect/empty_file.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire::test {
namespace {

constexpr int kDefaultCount = 500;
constexpr double kCountedShare = 0.98;  // Least share of files with correct counts of steps.
constexpr double kLegTolerance = 0.05;  // Relative error of the length of a leg.

unsigned FromEnvironment(const char* name, unsigned otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : static_cast<unsigned>(std::strtoul(text, nullptr, 10));
}

unsigned FirstSeed() { return FromEnvironment("STRIDEWIRE_CORPUS_SEED", 1); }

int CaseCount(double share) {
  const unsigned count = FromEnvironment("STRIDEWIRE_CORPUS_COUNT", kDefaultCount);
  return std::max(1, static_cast<int>(share * count));
}

// Result of building a library from one file.
struct Outcome {
  bool has_library = false;
  std::array<int, 2> steps{};
  int jumps = 0;
  double leg_m = 0.0;
  DVec3 mean_move_m = DVec3(0.0);      // As in CorpusCase.
  std::vector<std::string> sentences;  // Errors, reasons and notes.

  [[nodiscard]] std::string Text() const {
    std::string text;
    for (const std::string& sentence : sentences) text += "\n    " + sentence;
    return text;
  }
  [[nodiscard]] bool Says(std::initializer_list<std::string_view> words) const {
    std::string text = Text();
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
    return std::ranges::any_of(
        words, [&](std::string_view word) { return text.find(word) != std::string::npos; });
  }
};

double LengthOfLegs(const Skeleton& skeleton) {
  double length = 0.0;
  for (const Leg& leg : skeleton.legs) {
    for (int j = leg.ankle; j > leg.hip; j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
      length += 0.5 * glm::length(skeleton.joints[static_cast<std::size_t>(j)].offset_m);
    }
  }
  return length;
}

Outcome Build(const CorpusCase& file) {
  Outcome outcome;
  const auto capture = ParseBvh(file.bvh, "corpus.bvh");
  if (!capture) {
    outcome.sentences.push_back(Describe(capture.error()));
    return outcome;
  }
  LibraryAssembler assembler;
  const Extraction& extraction = assembler.Add(*capture);
  outcome.steps = {extraction.steps_left, extraction.steps_right};
  outcome.jumps = extraction.jumps;
  outcome.leg_m = LengthOfLegs(extraction.skeleton);
  for (const ExtractedExample& step : extraction.general_steps) {
    const std::vector<double>& p = step.example.parameters;
    outcome.mean_move_m +=
        DVec3(p[3] - p[0], 0.0, p[5] - p[2]) / static_cast<double>(extraction.general_steps.size());
  }
  outcome.sentences = extraction.notes;
  for (const RejectedTime& time : extraction.rejected) outcome.sentences.push_back(time.reason);
  if (std::string reason = ReasonForNoMovements(extraction, true, true); !reason.empty()) {
    outcome.sentences.push_back(std::move(reason));
  }
  const auto raw = assembler.Assemble();
  if (!raw) {
    outcome.sentences.push_back(Describe(raw.error()));
    return outcome;
  }
  const auto library = LibraryBuilder::Selecting().Build(*raw);
  outcome.has_library = library.has_value();
  if (!library) outcome.sentences.push_back(Describe(library.error()));
  return outcome;
}

std::string Report(const CorpusCase& file, const Outcome& outcome) {
  std::string text(MovementName(file.movement));
  text += Text(": seed %u: expected %d + %d steps and %d jumps, found %d + %d and %d", file.seed,
               file.steps[0], file.steps[1], file.jumps, outcome.steps[0], outcome.steps[1],
               outcome.jumps);
  text += Text("; legs of %.3f m, found %.3f m", file.leg_m, outcome.leg_m);
  text += Text("; feet move (%.2f, %.2f) m, found (%.2f, %.2f) m\n  ", file.mean_move_m.x,
               file.mean_move_m.z, outcome.mean_move_m.x, outcome.mean_move_m.z);
  text += file.description + outcome.Text();
  if (const char* folder = std::getenv("STRIDEWIRE_CORPUS_DUMP"); folder != nullptr) {
    const std::filesystem::path path =
        std::filesystem::path(folder) /
        (std::string(MovementName(file.movement)) + '_' + std::to_string(file.seed) + ".bvh");
    std::filesystem::create_directories(folder);
    std::ofstream(path, std::ios::binary) << file.bvh;
    text += "\n  written to " + path.string();
  } else {
    text += "\n  Set STRIDEWIRE_CORPUS_DUMP to a folder to write the file there.";
  }
  return text + '\n';
}

bool CountsMatch(const CorpusCase& file, const Outcome& outcome) {
  return outcome.has_library && std::abs(outcome.steps[0] - file.steps[0]) <= 1 &&
         std::abs(outcome.steps[1] - file.steps[1]) <= 1 && outcome.jumps == file.jumps;
}

bool LegsMatch(const CorpusCase& file, const Outcome& outcome) {
  return std::fabs(outcome.leg_m - file.leg_m) < kLegTolerance * file.leg_m;
}

bool MovesMatch(const CorpusCase& file, const Outcome& outcome) {
  return glm::length(outcome.mean_move_m - file.mean_move_m) <= file.move_tolerance_m;
}

// Returns true if a library has too many steps, steps in another direction or of another size, or
// lacks steps without a stated reason.
bool IsSilentlyWrong(const CorpusCase& file, const Outcome& outcome) {
  if (!outcome.has_library) return outcome.sentences.empty();
  const bool too_many = outcome.steps[0] > file.steps[0] + 1 ||
                        outcome.steps[1] > file.steps[1] + 1 || outcome.jumps > file.jumps;
  const bool unexplained = !CountsMatch(file, outcome) && outcome.sentences.empty();
  return too_many || unexplained || !LegsMatch(file, outcome) || !MovesMatch(file, outcome);
}

// Checks `count` files of a movement with steps or jumps.
void ExpectCounted(Movement movement, int count) {
  const unsigned seed = FirstSeed();
  std::cout << "STRIDEWIRE_CORPUS_SEED=" << seed << ", " << count << " files\n";
  int right = 0;
  std::string failures;
  for (int i = 0; i < count; ++i) {
    const CorpusCase file = DrawCase(movement, seed + static_cast<unsigned>(i));
    const Outcome outcome = Build(file);
    const bool counted =
        CountsMatch(file, outcome) && LegsMatch(file, outcome) && MovesMatch(file, outcome);
    right += counted ? 1 : 0;
    EXPECT_FALSE(IsSilentlyWrong(file, outcome)) << Report(file, outcome);
    if (!counted) failures += Report(file, outcome);
  }
  std::cout << right << " of " << count << " files counted right\n" << failures;
  EXPECT_GE(right, kCountedShare * count) << failures;
}

// Checks that files of a movement give no library, unless `may_build`, and that a reason or note
// contains one of these words.
void ExpectRefused(Movement movement, std::initializer_list<std::string_view> words,
                   bool may_build = false) {
  const unsigned seed = FirstSeed();
  const int count = CaseCount(0.02);
  std::cout << "STRIDEWIRE_CORPUS_SEED=" << seed << ", " << count << " files\n";
  for (int i = 0; i < count; ++i) {
    const CorpusCase file = DrawCase(movement, seed + static_cast<unsigned>(i));
    const Outcome outcome = Build(file);
    EXPECT_TRUE(may_build || !outcome.has_library) << Report(file, outcome);
    EXPECT_TRUE(outcome.Says(words))
        << "no reason contains " << testing::PrintToString(std::vector<std::string_view>(words))
        << '\n'
        << Report(file, outcome);
  }
}

TEST(Corpus, CountsWalks) { ExpectCounted(Movement::kWalk, CaseCount(0.6)); }
TEST(Corpus, CountsJumps) { ExpectCounted(Movement::kJump, CaseCount(0.1)); }
TEST(Corpus, RefusesRuns) { ExpectRefused(Movement::kRun, {"run"}); }
TEST(Corpus, RefusesStanding) {
  ExpectRefused(Movement::kStand, {"never leave the floor", "nothing moves"});
}
TEST(Corpus, RefusesDances) {
  ExpectRefused(Movement::kDance, {"never leaves the floor", "never stands still on the ground"});
}
TEST(Corpus, RefusesSitting) { ExpectRefused(Movement::kSit, {"sits", "never leave the floor"}); }
TEST(Corpus, RefusesLying) { ExpectRefused(Movement::kLie, {"lies"}); }
TEST(Corpus, RefusesCrawling) {
  ExpectRefused(Movement::kCrawl, {"crawls", "stands on hands and feet"});
}
TEST(Corpus, RefusesHanging) {
  ExpectRefused(Movement::kHang,
                {"never stand still on the ground", "something holds", "never leave the floor"});
}
TEST(Corpus, RefusesMarching) { ExpectRefused(Movement::kMarch, {"on the spot", "lands only"}); }
TEST(Corpus, RefusesWalksInPlace) { ExpectRefused(Movement::kWalkInPlace, {"walks on the spot"}); }
TEST(Corpus, ExplainsSlowWalks) { ExpectRefused(Movement::kSlowWalk, {"frame time"}, true); }
TEST(Corpus, RefusesFastJumps) { ExpectRefused(Movement::kFastJump, {"m/s^2"}); }
TEST(Corpus, RefusesOneFrame) { ExpectRefused(Movement::kOneFrame, {"only one usable frame"}); }
TEST(Corpus, RefusesFrozenPoses) { ExpectRefused(Movement::kFrozen, {"nothing moves"}); }

}  // namespace
}  // namespace stridewire::test
