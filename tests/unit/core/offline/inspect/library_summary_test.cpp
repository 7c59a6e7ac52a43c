#include "offline/inspect/library_summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "offline/inspect/inspect_json.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/open_library.h"
#include "test_library.h"

namespace stridewire {
namespace {

using testing::Contains;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

std::shared_ptr<const MotionLibrary> Build(const RawLibrary& raw) {
  auto library = LibraryBuilder().Build(raw);
  EXPECT_TRUE(library) << Describe(library.error());
  return *library;
}

// Returns the test library with a different source for each example of a group.
RawLibrary Walker() {
  RawLibrary raw = MakeTestRawLibrary();
  for (RawGroup& group : raw.groups) {
    for (std::size_t e = 0; e < group.examples.size(); ++e) {
      group.examples[e].source = "walk.bvh " + std::to_string(e) + " s";
    }
  }
  return raw;
}

RawLibrary Without(MovementKind kind) {
  RawLibrary raw = Walker();
  std::erase_if(raw.groups, [&](const RawGroup& group) { return group.kind == kind; });
  return raw;
}

TEST(LibrarySummary, CountsWhatTheBuiltinLibraryCanDo) {
  const auto library = OpenLibrary("builtin");
  ASSERT_TRUE(library);
  const LibrarySummary summary = Summarize(**library);
  EXPECT_THAT(summary.missing, IsEmpty());
  EXPECT_TRUE(summary.has_stand());
  EXPECT_EQ(summary.steps.captured, 0);
  EXPECT_EQ(summary.steps.mirrored, 0);
  EXPECT_EQ(summary.steps.total(), summary.feet[0] + summary.feet[1]);
  for (const std::size_t side : {0u, 1u}) {
    SCOPED_TRACE(side);
    EXPECT_TRUE(summary.starts[side].is_available());
    EXPECT_TRUE(summary.stops[side].is_available());
    EXPECT_NEAR(summary.strides[side].range.max, 0.75, 0.01);
    EXPECT_NEAR(summary.turns[side].range.max, 60.0, 1.0);
    EXPECT_NEAR(summary.back_steps[side].range.max, 0.4, 0.01);
    EXPECT_NEAR(summary.climbs[side].range.max, 0.25, 0.01);
    EXPECT_NEAR(summary.descents[side].range.max, 0.25, 0.01);
    EXPECT_GT(summary.side_steps[side].range.max, 0.2);
  }
  EXPECT_NEAR(summary.jumps.range.min, 0.3, 0.01);
  EXPECT_NEAR(summary.jumps.range.max, 1.5, 0.01);
  EXPECT_GT(summary.speed_m_s.min, 0.0);
  EXPECT_LT(summary.speed_m_s.max, 2.0);
}

TEST(LibrarySummary, NamesTheMissingSideAndTheOptionThatAddsIt) {
  const LibrarySummary summary = Summarize(*Build(Without(MovementKind::kStepRight)));
  EXPECT_FALSE(summary.has_steps_of(Foot::kRight));
  EXPECT_THAT(summary.missing,
              Contains(testing::AllOf(Field(&MissingAbility::what, "steps with the right foot"),
                                      Field(&MissingAbility::advice, HasSubstr("--mirror")))));
}

TEST(LibrarySummary, DoesNotAdviseToMirrorAMirroredLibrary) {
  RawLibrary raw = Without(MovementKind::kStepRight);
  for (RawGroup& group : raw.groups) {
    for (RawExample& example : group.examples) example.mirrored = true;
  }
  const LibrarySummary summary = Summarize(*Build(raw));
  EXPECT_THAT(summary.missing, Not(IsEmpty()));
  EXPECT_THAT(summary.missing,
              testing::Each(Field(&MissingAbility::advice, Not(HasSubstr("--mirror")))));
}

TEST(LibrarySummary, NamesTheRecordingThatAddsAMovement) {
  const LibrarySummary summary = Summarize(*Build(Without(MovementKind::kJump)));
  EXPECT_FALSE(summary.jumps.is_available());
  EXPECT_THAT(summary.missing,
              Contains(testing::AllOf(Field(&MissingAbility::what, "jumps"),
                                      Field(&MissingAbility::advice, HasSubstr("Record")))));
  EXPECT_THAT(DescribeSummary(summary), Contains("Jumps: none."));
}

TEST(LibrarySummary, DistinguishesCapturedFromMirroredAndGeneratedExamples) {
  RawLibrary raw = Walker();
  int captured = 0;
  int mirrored = 0;
  for (RawGroup& group : raw.groups) {
    for (std::size_t e = 0; IsStep(group.kind) && e < group.examples.size(); ++e) {
      const bool is_left = group.kind == MovementKind::kStepLeft;
      group.examples[e].mirrored = !is_left;
      ++(is_left ? captured : mirrored);
    }
  }
  const LibrarySummary summary = Summarize(*Build(raw));
  EXPECT_EQ(summary.steps.captured, captured);
  EXPECT_EQ(summary.steps.mirrored, mirrored);
  EXPECT_EQ(summary.steps.generated, 0);
}

TEST(LibrarySummary, CountsAnExampleInSeveralGroupsOnce) {
  RawLibrary raw = Walker();
  int once = 0;
  for (const RawGroup& group : raw.groups) {
    if (IsStep(group.kind)) once += static_cast<int>(group.examples.size());
  }
  EXPECT_EQ(Summarize(*Build(raw)).steps.total(), once);
  RawGroup copy = raw.groups.front();
  ASSERT_TRUE(IsStep(copy.kind));
  for (RawExample& example : copy.examples) example.source += " and 2 like it";
  raw.groups.push_back(copy);
  EXPECT_EQ(Summarize(*Build(raw)).steps.total(), once);
}

TEST(LibrarySummary, JsonContainsTheSentencesAndWhatIsMissing) {
  const LibrarySummary summary = Summarize(*Build(Without(MovementKind::kStepRight)));
  const nlohmann::ordered_json json = SummaryToJson(summary);
  for (const char* key : {"starts", "stops", "turns", "side_steps", "back_steps", "heights",
                          "speeds_m_s", "strides", "jumps"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  EXPECT_EQ(json["sentences"].get<std::vector<std::string>>(), DescribeSummary(summary));
  EXPECT_EQ(json["missing"].size(), summary.missing.size());
  EXPECT_EQ(json["strides"]["right"]["length_m"], nullptr);
  EXPECT_GT(json["strides"]["left"]["length_m"]["max"], 0.5);
}

}  // namespace
}  // namespace stridewire
