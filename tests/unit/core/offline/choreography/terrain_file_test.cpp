#include "offline/choreography/terrain_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include "bad_text.h"
#include "mutated_text.h"

namespace stridewire {
namespace {

constexpr const char* kBoth = R"({
  "height_field": {"origin_m": [-1, 2.5], "cell_m": 0.25, "columns": 3, "rows": 2,
                   "heights_m": [0, 0.125, 0.25, -1, 1e3, 0.5]},
  "boxes": [{"min_m": [0, 1], "max_m": [2, 3], "height_m": 0.5},
            {"min_m": [-4, -4], "max_m": [-3.5, -3], "height_m": -0.25}]})";

TEST(ParseTerrain, ReadsFieldAndBoxes) {
  const auto read = ParseTerrain(kBoth, "t.json");
  ASSERT_TRUE(read.has_value()) << Describe(read.error());
  TerrainData expected;
  expected.height_field =
      HeightField{{-1.0, 2.5}, 0.25, 3, 2, {0.0f, 0.125f, 0.25f, -1.0f, 1e3f, 0.5f}};
  expected.boxes = {{{0, 1}, {2, 3}, 0.5}, {{-4, -4}, {-3.5, -3}, -0.25}};
  EXPECT_EQ((*read)->data(), expected);
}

TEST(ParseTerrain, FieldAndBoxesAreOptional) {
  for (const char* text : {"{}", R"({"boxes":[]})"}) {
    const auto read = ParseTerrain(text, "t.json");
    ASSERT_TRUE(read.has_value()) << Describe(read.error());
    EXPECT_EQ((*read)->data(), TerrainData{});
  }
}

const BadText kBadTerrains[] = {
    {"{", ErrorCode::kMalformed, "t.json:1:1: invalid JSON near this position"},
    {"3", ErrorCode::kMalformed, "t.json: expected an object"},
    {R"({"box":[]})", ErrorCode::kMalformed, "t.json: box: unknown key"},
    {R"({"boxes":{}})", ErrorCode::kMalformed, "t.json: boxes: expected an array"},
    {R"({"boxes":[[]]})", ErrorCode::kMalformed, "t.json: boxes[0]: expected an object"},
    {R"({"boxes":[{"max_m":[1,1],"height_m":1}]})", ErrorCode::kMalformed,
     "t.json: boxes[0].min_m: required key is missing"},
    {R"({"boxes":[{"min_m":[1],"max_m":[1,1],"height_m":1}]})", ErrorCode::kMalformed,
     "t.json: boxes[0].min_m: expected an array of two numbers"},
    {R"({"boxes":[{"min_m":[0,true],"max_m":[1,1],"height_m":1}]})", ErrorCode::kMalformed,
     "t.json: boxes[0].min_m[1]: expected a number from -1000000 to 1000000 m"},
    {R"({"boxes":[{"min_m":[0,0],"max_m":[1,1]}]})", ErrorCode::kMalformed,
     "t.json: boxes[0].height_m: required key is missing"},
    {R"({"boxes":[{"min_m":[0,0],"max_m":[1,1],"height_m":20000}]})", ErrorCode::kOutOfRange,
     "t.json: boxes[0].height_m: expected a number from -10000 to 10000 m"},
    {R"({"boxes":[{"min_m":[0,0],"max_m":[-1,1],"height_m":0}]})", ErrorCode::kOutOfRange,
     "t.json: boxes[0].max_m: expected values above min_m"},
    {R"({"height_field":null})", ErrorCode::kMalformed, "t.json: height_field: expected an object"},
    {R"({"height_field":{"origin_m":[0,0],"cell_m":0,"columns":2,"rows":2,"heights_m":[0,0,0,0]}})",
     ErrorCode::kOutOfRange, "t.json: height_field.cell_m: expected a number from 0.01 to 1000 m"},
    {R"({"height_field":{"origin_m":[0,0],"cell_m":1,"columns":2.5,"rows":2,"heights_m":[]}})",
     ErrorCode::kOutOfRange, "t.json: height_field.columns: expected an integer from 2 to 1024"},
    {R"({"height_field":{"origin_m":[0,0],"cell_m":1,"columns":2,"rows":"2","heights_m":[]}})",
     ErrorCode::kMalformed, "t.json: height_field.rows: expected an integer from 2 to 1024"},
    {R"({"height_field":{"origin_m":[0,0],"cell_m":1,"columns":2,"rows":2,"heights_m":[0,0,0]}})",
     ErrorCode::kShapeMismatch,
     "t.json: height_field.heights_m: expected columns * rows numbers (3)"},
    {R"({"height_field":{"origin_m":[0,0],"cell_m":1,"columns":2,"rows":2,"heights_m":[0,0,0,1e300]}})",
     ErrorCode::kOutOfRange,
     "t.json: height_field.heights_m[3]: expected a number from -10000 to 10000 m"},
};

TEST(ParseTerrain, ErrorsNameFileFieldAndReason) {
  ExpectErrors(kBadTerrains, [](const char* text) { return ParseTerrain(text, "t.json"); });
  const auto too_long = ParseTerrain(std::string(kMaxTerrainFileBytes + 1, ' '), "t.json");
  ASSERT_FALSE(too_long.has_value());
  EXPECT_EQ(too_long.error().code, ErrorCode::kLimitExceeded);
}

TEST(ParseTerrain, SurvivesMutatedText) {
  ParseMutated(
      kBoth, 10'000, "t.json", [](const std::string& text) { return ParseTerrain(text, "t.json"); },
      [](const auto& terrain) {
        EXPECT_LE(std::abs(terrain->HeightAt(0.5, 2.5)), kMaxTerrainHeightM);
      });
}

TEST(ReadTerrain, ReadsAFileOrReportsThatItIsMissing) {
  const std::string path = testing::TempDir() + "terrain_" + std::to_string(getpid()) + ".json";
  std::ofstream(path) << kBoth;
  const auto read = ReadTerrain(path);
  std::remove(path.c_str());
  ASSERT_TRUE(read.has_value()) << Describe(read.error());
  EXPECT_EQ((*read)->data().boxes.size(), 2u);

  const auto missing = ReadTerrain(path);
  ASSERT_FALSE(missing.has_value());
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(missing.error().where, path);
}

}  // namespace
}  // namespace stridewire
