#include "stridewire/offline/choreography.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <string>

#include "bad_text.h"
#include "mutated_text.h"

namespace stridewire {
namespace {

constexpr const char* kEverything = R"({
  "start": {"position_m": [1, 0.5, -2], "heading_rad": 0.25},
  "movements": [{"step": {"length_m": 0.6}},
                {"step": {"foot": "left", "length_m": 0.5, "side_m": 0.1, "height_m": 0.15,
                          "turn_rad": 0.3}},
                {"step": {"foot": "right", "length_m": -0.25}},
                {"jump": {"length_m": 0.9, "height_m": 0.125, "turn_rad": -1}},
                {"stand": {"seconds": 1.5}}]})";

TEST(ParseChoreography, ReadsEveryMovement) {
  const Expected<Choreography> read = ParseChoreography(kEverything, "c.json");
  ASSERT_TRUE(read.has_value()) << Describe(read.error());
  EXPECT_EQ(read->start.position_m, DVec3(1.0, 0.5, -2.0));
  EXPECT_EQ(read->start.heading_rad, 0.25);
  ASSERT_EQ(read->movements.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(read->movements[i].id, i + 1);

  const auto& plain = std::get<StepRequest>(read->movements[0].movement);
  EXPECT_FALSE(plain.foot.has_value());
  EXPECT_EQ(plain.length_m, 0.6);
  EXPECT_FALSE(plain.side_m.has_value());
  EXPECT_EQ(plain.height_m, 0.0);
  EXPECT_EQ(plain.turn_rad, 0.0);

  const auto& full = std::get<StepRequest>(read->movements[1].movement);
  EXPECT_EQ(full.foot, Foot::kLeft);
  EXPECT_EQ(full.length_m, 0.5);
  EXPECT_EQ(full.side_m, 0.1);
  EXPECT_EQ(full.height_m, 0.15);
  EXPECT_EQ(full.turn_rad, 0.3);

  EXPECT_EQ(std::get<StepRequest>(read->movements[2].movement).foot, Foot::kRight);
  EXPECT_EQ(std::get<StepRequest>(read->movements[2].movement).length_m, -0.25);

  const auto& jump = std::get<JumpRequest>(read->movements[3].movement);
  EXPECT_EQ(jump.length_m, 0.9);
  EXPECT_EQ(jump.height_m, 0.125);
  EXPECT_EQ(jump.turn_rad, -1.0);
  EXPECT_EQ(std::get<StandRequest>(read->movements[4].movement).seconds, 1.5);
}

TEST(ParseChoreography, ReadsLayersBetweenMovements) {
  const Expected<Choreography> read = ParseChoreography(
      R"({"movements":[{"layer":{"name":"wave"}},{"step":{"length_m":0.5}},
          {"layer":{"name":"carry","weight":0.5,"blend_s":0.75,"speed":2}},
          {"layer":{"name":"wave","enabled":false}},{"stand":{"seconds":1}}]})",
      "c.json");
  ASSERT_TRUE(read.has_value()) << Describe(read.error());
  ASSERT_EQ(read->movements.size(), 2u);
  EXPECT_EQ(read->movements[0].id, 2u);  // Position in the JSON list, from 1.
  EXPECT_EQ(read->movements[1].id, 5u);
  ASSERT_EQ(read->layers.size(), 3u);
  EXPECT_EQ(read->layers[0].before, 0u);
  EXPECT_EQ(read->layers[0].layer, "wave");
  EXPECT_EQ(read->layers[0].weight, 1.0);
  EXPECT_EQ(read->layers[1].before, 1u);
  EXPECT_EQ(read->layers[1].weight, 0.5);
  EXPECT_EQ(read->layers[1].blend_s, 0.75);
  EXPECT_EQ(read->layers[1].speed, 2.0);
  EXPECT_TRUE(read->layers[1].enabled);
  EXPECT_EQ(read->layers[2].before, 1u);
  EXPECT_FALSE(read->layers[2].enabled);

  const auto error_of = [](const char* layer) {
    const std::string text =
        R"({"movements":[{"stand":{"seconds":1}},{"layer":)" + std::string(layer) + "}]}";
    return Describe(ParseChoreography(text, "c.json").error());
  };
  EXPECT_THAT(error_of("{}"),
              testing::HasSubstr("c.json: movements[1].layer.name: required key is missing"));
  EXPECT_THAT(error_of(R"({"name":3})"),
              testing::HasSubstr("layer.name: expected a non-empty string"));
  EXPECT_THAT(error_of(R"({"name":"a","weight":1.5})"),
              testing::HasSubstr("layer.weight: expected a number from 0 to 1"));
  EXPECT_THAT(error_of(R"({"name":"a","enabled":1})"),
              testing::HasSubstr("layer.enabled: expected true or false"));
  EXPECT_THAT(error_of(R"({"name":"a","mask":1})"), testing::HasSubstr("mask"));
  EXPECT_EQ(ParseChoreography(R"({"movements":[{"layer":{"name":"a"}}]})", "c.json").error().code,
            ErrorCode::kOutOfRange);
}

TEST(ParseChoreography, StartsAtTheOriginByDefault) {
  for (const char* text : {R"({"movements":[{"stand":{"seconds":0}}]})",
                           R"({"start":{},"movements":[{"stand":{"seconds":0}}]})"}) {
    const Expected<Choreography> read = ParseChoreography(text, "c.json");
    ASSERT_TRUE(read.has_value()) << Describe(read.error());
    EXPECT_EQ(read->start.position_m, DVec3(0.0));
    EXPECT_EQ(read->start.heading_rad, 0.0);
  }
}

TEST(ParseChoreography, ReadsFootprints) {
  const Expected<Choreography> read = ParseChoreography(
      R"({"movements":[{"step":{"foot":"right","at_m":[1,0.25,-2],"heading_rad":0.5}},
                       {"step":{"at_m":[0,0,0],"exact_only":true}}]})",
      "c.json");
  ASSERT_TRUE(read.has_value()) << Describe(read.error());
  const auto& first = std::get<StepRequest>(read->movements[0].movement);
  EXPECT_EQ(first.foot, Foot::kRight);
  ASSERT_TRUE(first.at.has_value());
  EXPECT_EQ(first.at->position_m, DVec3(1.0, 0.25, -2.0));
  EXPECT_EQ(first.at->heading_rad, 0.5);
  const auto& second = std::get<StepRequest>(read->movements[1].movement);
  ASSERT_TRUE(second.at.has_value());
  EXPECT_FALSE(second.at->heading_rad.has_value());
  EXPECT_FALSE(first.exact_only);
  EXPECT_TRUE(second.exact_only);
}

TEST(ParseChoreography, ReadsHowFarMovementsMayMiss) {
  const Expected<Choreography> read = ParseChoreography(
      R"({"movements":[{"step":{"length_m":1,"exact_only":true}},
                       {"step":{"at_m":[0,0,9],"allow_nearest":true}},
                       {"jump":{"length_m":2,"allow_nearest":true}}, {"jump":{"length_m":2}}]})",
      "c.json");
  ASSERT_TRUE(read.has_value()) << Describe(read.error());
  EXPECT_TRUE(std::get<StepRequest>(read->movements[0].movement).exact_only);
  EXPECT_FALSE(std::get<StepRequest>(read->movements[0].movement).allow_nearest);
  EXPECT_TRUE(std::get<StepRequest>(read->movements[1].movement).allow_nearest);
  EXPECT_TRUE(std::get<JumpRequest>(read->movements[2].movement).allow_nearest);
  EXPECT_FALSE(std::get<JumpRequest>(read->movements[3].movement).allow_nearest);
}

TEST(ParseChoreography, ReadsWalks) {
  const Expected<Choreography> read = ParseChoreography(
      R"({"movements":[{"walk_to":{"position_m":[3,0,5],"heading_rad":1.5}},
                       {"walk_to":{"position_m":[0,0,1],"heading_rad":0,
                                   "waypoints_m":[[1,0,2],[3,0,4]],"speed_m_s":1.25}}]})",
      "c.json");
  ASSERT_TRUE(read.has_value()) << Describe(read.error());
  const auto& plain = std::get<WalkRequest>(read->movements[0].movement);
  EXPECT_EQ(plain.position_m, DVec3(3.0, 0.0, 5.0));
  EXPECT_EQ(plain.heading_rad, 1.5);
  EXPECT_TRUE(plain.waypoints_m.empty());
  EXPECT_FALSE(plain.speed_m_s.has_value());
  const auto& full = std::get<WalkRequest>(read->movements[1].movement);
  ASSERT_EQ(full.waypoints_m.size(), 2u);
  EXPECT_EQ(full.waypoints_m[1], DVec3(3.0, 0.0, 4.0));
  EXPECT_EQ(full.speed_m_s, 1.25);
}

TEST(ParseChoreography, ReadsTerrain) {
  const Expected<Choreography> read = ParseChoreography(
      R"({"terrain":{"boxes":[{"min_m":[0,1],"max_m":[2,3],"height_m":0.5}]},
          "movements":[{"stand":{"seconds":0}}]})",
      "c.json");
  ASSERT_TRUE(read.has_value()) << Describe(read.error());
  ASSERT_NE(read->terrain, nullptr);
  EXPECT_EQ(read->terrain->HeightAt(1.0, 2.0), 0.5);
  EXPECT_EQ(read->terrain->HeightAt(3.0, 2.0), 0.0);
  EXPECT_EQ(ParseChoreography(kEverything, "c.json")->terrain, nullptr);
}

TEST(ParseChoreography, AcceptsNumbersAtTheirLimits) {
  const Expected<Choreography> read = ParseChoreography(
      R"({"start":{"position_m":[1e5,-1e5,0],"heading_rad":-1e4},
          "movements":[{"step":{"length_m":10,"side_m":-10,"height_m":-10,"turn_rad":3.2}},
                       {"stand":{"seconds":3600}}]})",
      "c.json");
  EXPECT_TRUE(read.has_value()) << Describe(read.error());
}

/// One case per kind of error.
const BadText kBadTexts[] = {
    {"", ErrorCode::kMalformed, "c.json:1:1: invalid JSON near this position"},
    {"{\"movements\":[\n  {\"step\" 3}]}", ErrorCode::kMalformed,
     "c.json:2:12: invalid JSON near this position"},
    {"{\"movements\":[]} 3", ErrorCode::kMalformed, "c.json:1:18: invalid JSON near this position"},
    {"{\"movements\":[\xff]}", ErrorCode::kMalformed,
     "c.json:1:15: invalid JSON near this position"},
    {R"({"movements":[{"jump":{"length_m":1e999}}]})", ErrorCode::kOutOfRange,
     "c.json:1:40: the number before this position is too large for a double"},
    {R"({"start":{},"start":{}})", ErrorCode::kMalformed,
     "c.json:1:19: duplicate key before this position"},
    {"[[[[[[[[[[[[[[[[[0]]]]]]]]]]]]]]]]]", ErrorCode::kLimitExceeded,
     "c.json:1:17: arrays and objects are nested too deeply"},
    {"[]", ErrorCode::kMalformed, "c.json: expected an object"},
    {R"({"movement":[]})", ErrorCode::kMalformed, "c.json: movement: unknown key"},
    {R"({"a\u0007\u00e4":[]})", ErrorCode::kMalformed, "c.json: a???: unknown key"},
    {"{}", ErrorCode::kMalformed, "c.json: movements: required key is missing"},
    {R"({"movements":{}})", ErrorCode::kMalformed, "c.json: movements: expected an array"},
    {R"({"movements":[]})", ErrorCode::kOutOfRange,
     "c.json: movements: expected at least one movement"},
    {R"({"terrain":[],"movements":[]})", ErrorCode::kMalformed,
     "c.json: terrain: expected an object"},
    {R"({"terrain":{"boxes":[{"min_m":[0,0],"max_m":[1,0],"height_m":0.5}]},"movements":[]})",
     ErrorCode::kOutOfRange, "c.json: terrain.boxes[0].max_m: expected values above min_m"},
    {R"({"start":[],"movements":[]})", ErrorCode::kMalformed, "c.json: start: expected an object"},
    {R"({"start":{"x":0},"movements":[]})", ErrorCode::kMalformed, "c.json: start.x: unknown key"},
    {R"({"start":{"position_m":[0,0]},"movements":[]})", ErrorCode::kMalformed,
     "c.json: start.position_m: expected an array of three numbers"},
    {R"({"start":{"position_m":[0,"0",0]},"movements":[]})", ErrorCode::kMalformed,
     "c.json: start.position_m[1]: expected a number from -100000 to 100000 m"},
    {R"({"start":{"position_m":[0,0,100001]},"movements":[]})", ErrorCode::kOutOfRange,
     "c.json: start.position_m[2]: expected a number from -100000 to 100000 m"},
    {R"({"start":{"heading_rad":1e5},"movements":[]})", ErrorCode::kOutOfRange,
     "c.json: start.heading_rad: expected a number from -10000 to 10000 rad"},
    {R"({"movements":[1]})", ErrorCode::kMalformed, "c.json: movements[0]: expected an object"},
    {R"({"movements":[{}]})", ErrorCode::kMalformed,
     "c.json: movements[0]: expected exactly one of step, walk_to, jump, stand and layer"},
    {R"({"movements":[{"stand":{"seconds":1},"jump":{"length_m":1}}]})", ErrorCode::kMalformed,
     "c.json: movements[0]: expected exactly one of step, walk_to, jump, stand and layer"},
    {R"({"movements":[{"stand":{"seconds":1}},{"hop":{}}]})", ErrorCode::kMalformed,
     "c.json: movements[1].hop: unknown key"},
    {R"({"movements":[{"walk_to":{"heading_rad":1}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].walk_to.position_m: required key is missing"},
    {R"({"movements":[{"walk_to":{"position_m":[0,0,1]}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].walk_to.heading_rad: required key is missing"},
    {R"({"movements":[{"walk_to":{"position_m":[0,0,1],"heading_rad":0,"waypoints_m":[[0,1]]}}]})",
     ErrorCode::kMalformed,
     "c.json: movements[0].walk_to.waypoints_m[0]: expected an array of three numbers"},
    {R"({"movements":[{"walk_to":{"position_m":[0,0,1],"heading_rad":0,"speed_m_s":0}}]})",
     ErrorCode::kOutOfRange,
     "c.json: movements[0].walk_to.speed_m_s: expected a number from 0.05 to 5 m/s"},
    {R"({"movements":[{"step":0.6}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step: expected an object"},
    {R"({"movements":[{"step":{}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.length_m: required key is missing"},
    {R"({"movements":[{"step":{"lenght_m":1}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.lenght_m: unknown key"},
    {R"({"movements":[{"step":{"at_m":[0,1]}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.at_m: expected an array of three numbers"},
    {R"({"movements":[{"step":{"at_m":[0,0,1e6]}}]})", ErrorCode::kOutOfRange,
     "c.json: movements[0].step.at_m[2]: expected a number from -100000 to 100000 m"},
    {R"({"movements":[{"step":{"at_m":[0,0,1],"heading_rad":true}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.heading_rad: expected a number from -10000 to 10000 rad"},
    {R"({"movements":[{"step":{"at_m":[0,0,1],"turn_rad":0}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.turn_rad: cannot be combined with at_m"},
    {R"({"movements":[{"step":{"at_m":[0,0,1],"length_m":0.5}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.length_m: cannot be combined with at_m"},
    {R"({"movements":[{"step":{"length_m":0.5,"heading_rad":0}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.heading_rad: requires at_m"},
    {R"({"movements":[{"step":{"length_m":0.5,"exact_only":true,"allow_nearest":true}}]})",
     ErrorCode::kMalformed,
     "c.json: movements[0].step.exact_only: cannot be combined with allow_nearest"},
    {R"({"movements":[{"jump":{"length_m":0.5,"allow_nearest":"yes"}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].jump.allow_nearest: expected true or false"},
    {R"({"movements":[{"step":{"at_m":[0,0,1],"exact_only":1}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.exact_only: expected true or false"},
    {R"({"movements":[{"step":{"foot":"both","length_m":0.5}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.foot: expected \"left\" or \"right\""},
    {R"({"movements":[{"step":{"foot":1,"length_m":0.5}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.foot: expected \"left\" or \"right\""},
    {R"({"movements":[{"step":{"length_m":"0.5"}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.length_m: expected a number from -10 to 10 m"},
    {R"({"movements":[{"step":{"length_m":10.001}}]})", ErrorCode::kOutOfRange,
     "c.json: movements[0].step.length_m: expected a number from -10 to 10 m"},
    {R"({"movements":[{"step":{"length_m":0.5,"side_m":-11}}]})", ErrorCode::kOutOfRange,
     "c.json: movements[0].step.side_m: expected a number from -10 to 10 m"},
    {R"({"movements":[{"step":{"length_m":0.5,"height_m":null}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].step.height_m: expected a number from -10 to 10 m"},
    {R"({"movements":[{"step":{"length_m":0.5,"turn_rad":3.3}}]})", ErrorCode::kOutOfRange,
     "c.json: movements[0].step.turn_rad: expected a number from -3.2 to 3.2 rad"},
    {R"({"movements":[{"jump":null}]})", ErrorCode::kMalformed,
     "c.json: movements[0].jump: expected an object"},
    {R"({"movements":[{"jump":{"height_m":1}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].jump.length_m: required key is missing"},
    {R"({"movements":[{"jump":{"length_m":1,"side_m":1}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].jump.side_m: unknown key"},
    {R"({"movements":[{"jump":{"length_m":1,"height_m":-11}}]})", ErrorCode::kOutOfRange,
     "c.json: movements[0].jump.height_m: expected a number from -10 to 10 m"},
    {R"({"movements":[{"jump":{"length_m":1,"turn_rad":[]}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].jump.turn_rad: expected a number from -3.2 to 3.2 rad"},
    {R"({"movements":[{"stand":[]}]})", ErrorCode::kMalformed,
     "c.json: movements[0].stand: expected an object"},
    {R"({"movements":[{"stand":{}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].stand.seconds: required key is missing"},
    {R"({"movements":[{"stand":{"second":1}}]})", ErrorCode::kMalformed,
     "c.json: movements[0].stand.second: unknown key"},
    {R"({"movements":[{"stand":{"seconds":-0.5}}]})", ErrorCode::kOutOfRange,
     "c.json: movements[0].stand.seconds: expected a number from 0 to 3600 s"},
};

TEST(ParseChoreography, ErrorsNameFileFieldAndReason) {
  ExpectErrors(kBadTexts, [](const char* text) { return ParseChoreography(text, "c.json"); });
}

TEST(ParseChoreography, ShortensLongKeysInErrors) {
  const std::string text = "{\"" + std::string(1'000'000, 'k') + "\":0}";
  const Expected<Choreography> read = ParseChoreography(text, "c.json");
  ASSERT_FALSE(read.has_value());
  EXPECT_EQ(read.error().where, "c.json: " + std::string(64, 'k') + "...");
}

TEST(ParseChoreography, RejectsMoreThanItsLimits) {
  std::string many = R"({"movements":[{"stand":{"seconds":1}})";
  for (std::size_t i = 1; i < kMaxChoreographyMovements; ++i) many += R"(,{"stand":{"seconds":1}})";
  const Expected<Choreography> most = ParseChoreography(many + "]}", "c.json");
  ASSERT_TRUE(most.has_value()) << Describe(most.error());
  EXPECT_EQ(most->movements.size(), kMaxChoreographyMovements);

  const Expected<Choreography> too_many =
      ParseChoreography(many + R"(,{"stand":{"seconds":1}}]})", "c.json");
  ASSERT_FALSE(too_many.has_value());
  EXPECT_EQ(too_many.error().code, ErrorCode::kLimitExceeded);
  EXPECT_EQ(Describe(too_many.error()), "c.json: movements: expected at most 65536 movements");

  const Expected<Choreography> too_long =
      ParseChoreography(std::string(kMaxChoreographyBytes + 1, ' '), "c.json");
  ASSERT_FALSE(too_long.has_value());
  EXPECT_EQ(too_long.error().code, ErrorCode::kLimitExceeded);
  EXPECT_EQ(Describe(too_long.error()), "c.json: the file is larger than the limit of 4 MiB");
}

/// Expects all values to be within the documented limits.
void ExpectWithinLimits(const Choreography& choreography) {
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_LE(std::abs(choreography.start.position_m[axis]), kMaxChoreographyPositionM);
  }
  EXPECT_LE(std::abs(choreography.start.heading_rad), kMaxChoreographyHeadingRad);
  EXPECT_GE(choreography.movements.size(), 1u);
  std::uint64_t id = 0;
  for (const MovementRequest& request : choreography.movements) {
    EXPECT_EQ(request.id, ++id);
    if (const auto* step = std::get_if<StepRequest>(&request.movement)) {
      EXPECT_LE(std::abs(step->length_m), kMaxRequestLengthM);
      EXPECT_LE(std::abs(step->side_m.value_or(0.0)), kMaxRequestLengthM);
      EXPECT_LE(std::abs(step->height_m), kMaxRequestLengthM);
      EXPECT_LE(std::abs(step->turn_rad), kMaxRequestTurnRad);
    } else if (const auto* jump = std::get_if<JumpRequest>(&request.movement)) {
      EXPECT_LE(std::abs(jump->length_m), kMaxRequestLengthM);
      EXPECT_LE(std::abs(jump->height_m), kMaxRequestLengthM);
      EXPECT_LE(std::abs(jump->turn_rad), kMaxRequestTurnRad);
    } else {
      const double seconds = std::get<StandRequest>(request.movement).seconds;
      EXPECT_GE(seconds, 0.0);
      EXPECT_LE(seconds, kMaxStandS);
    }
  }
}

TEST(ParseChoreography, SurvivesMutatedText) {
  ParseMutated(
      kEverything, 20'000, "c.json",
      [](const std::string& text) { return ParseChoreography(text, "c.json"); },
      ExpectWithinLimits);
}

class ReadChoreographyFile : public ::testing::Test {
 protected:
  ReadChoreographyFile()
      : path_(std::filesystem::temp_directory_path() /
              ("stridewire_choreography_" + std::to_string(::getpid()) + ".json")) {}
  ~ReadChoreographyFile() override { std::filesystem::remove(path_); }

  std::filesystem::path path_;
};

TEST_F(ReadChoreographyFile, ReadsTheSameAsFromText) {
  std::ofstream(path_, std::ios::binary) << kEverything;
  const Expected<Choreography> read = ReadChoreography(path_);
  ASSERT_TRUE(read.has_value()) << Describe(read.error());
  EXPECT_EQ(read->movements.size(), 5u);
  EXPECT_EQ(read->start.heading_rad, 0.25);
}

TEST_F(ReadChoreographyFile, ReportsAMissingFile) {
  const Expected<Choreography> read = ReadChoreography(path_);
  ASSERT_FALSE(read.has_value());
  EXPECT_EQ(read.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(Describe(read.error()), path_.string() + ": there is no such file");
}

TEST_F(ReadChoreographyFile, ReportsADirectory) {
  const Expected<Choreography> read = ReadChoreography(path_.parent_path());
  ASSERT_FALSE(read.has_value());
  EXPECT_EQ(read.error().code, ErrorCode::kIo);
  EXPECT_EQ(Describe(read.error()),
            path_.parent_path().string() + ": expected a file, got a directory");
}

TEST_F(ReadChoreographyFile, RejectsLargeFilesWithoutReadingThem) {
  std::ofstream(path_, std::ios::binary) << '\n';
  std::filesystem::resize_file(path_,
                               std::uintmax_t{1} << 40);  // Sparse, so it uses no disk space.
  const Expected<Choreography> read = ReadChoreography(path_);
  ASSERT_FALSE(read.has_value());
  EXPECT_EQ(read.error().code, ErrorCode::kLimitExceeded);
}

TEST_F(ReadChoreographyFile, NamesTheFileInItsErrors) {
  std::ofstream(path_, std::ios::binary) << R"({"movements":[{"step":{"length_m":"far"}}]})";
  const Expected<Choreography> read = ReadChoreography(path_);
  ASSERT_FALSE(read.has_value());
  EXPECT_EQ(Describe(read.error()),
            path_.string() + ": movements[0].step.length_m: expected a number from -10 to 10 m");
}

}  // namespace
}  // namespace stridewire
