#include <set>

#include "protocol_testing.h"
#include "test_vectors.h"

namespace stridewire::protocol {
namespace {

TEST(Messages, RoundTrip) {
  for (const auto& [name, sample] : SampleMessages()) {
    SCOPED_TRACE(name);
    const auto frame = EncodeOrFail(sample);
    const auto decoded = Decode(frame, TypeOf(sample));
    ASSERT_TRUE(decoded) << Describe(decoded.error());
    EXPECT_TRUE(SameMessage(sample, *decoded));
    EXPECT_EQ(EncodeOrFail(*decoded), frame);
  }
}

TEST(Messages, RoundTripThroughJson) {
  for (const auto& [name, sample] : SampleMessages()) {
    if (std::holds_alternative<PoseBatch>(sample)) continue;
    SCOPED_TRACE(name);
    EXPECT_TRUE(SameMessage(FromJson(ToJson(sample)), sample));
  }
}

TEST(Messages, HaveASkeletonInJson) {
  const auto skeleton = [](std::string_view type) {
    return FromJson({{"type", type}, {"fields", nlohmann::ordered_json::object()}});
  };
  EXPECT_EQ(std::get<SetPlanting>(skeleton("SetPlanting")), SetPlanting{});
  EXPECT_EQ(std::get<WorldInfo>(skeleton("WorldInfo")), WorldInfo{});
  EXPECT_THROW((void)skeleton("Nothing"), std::invalid_argument);
}

TEST(Messages, HaveASampleOfEveryType) {
  std::set<std::size_t> alternatives;
  for (const auto& [name, sample] : SampleMessages()) alternatives.insert(sample.index());
  EXPECT_EQ(alternatives.size(), std::variant_size_v<Message>);
}

TEST(Messages, AreAppendedToOneBuffer) {
  Encoder encoder;
  std::vector<std::byte> frames;
  std::size_t bytes = 0;
  for (const auto& [name, sample] : SampleMessages()) {
    EXPECT_EQ(frames.size() % kPayloadAlignment, 0u);
    ASSERT_TRUE(encoder.Encode(sample, frames));
    const auto alone = EncodeOrFail(sample);
    ASSERT_EQ(frames.size(), bytes + alone.size());
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(),
                           frames.begin() + static_cast<std::ptrdiff_t>(bytes)));
    bytes = frames.size();
  }
}

// A request without must_be_near comes from a client that does not know the field. It gets the
// nearest movement, as before.
TEST(Messages, RequestsAllowTheNearestMovementOnlyIfTheyDoNotSayOtherwise) {
  for (const bool exact_only : {false, true}) {
    for (const bool allow_nearest : {false, true}) {
      if (exact_only && allow_nearest) continue;
      SCOPED_TRACE(testing::Message() << exact_only << " " << allow_nearest);
      const Request sent{
          1,
          1,
          {{1, 1, StepMovement{.exact_only = exact_only, .allow_nearest = allow_nearest}},
           {1, 2, JumpMovement{.length_m = 1.0, .allow_nearest = allow_nearest}}}};
      const auto received = Decode(EncodeOrFail(sent), MessageType::kRequest);
      ASSERT_TRUE(received);
      EXPECT_TRUE(SameMessage(sent, *received));
    }
  }
  int steps = 0;
  for (const auto& [name, sample] : SampleMessages()) {
    if (name != "request_footprints" && name != "request_refusals") continue;
    const auto old = Decode(EncodeOrFail(sample), MessageType::kRequest);
    ASSERT_TRUE(old);
    for (const RequestItem& item : std::get<Request>(*old).items) {
      const auto* step = std::get_if<StepMovement>(&item.movement);
      if (step == nullptr) continue;
      ++steps;
      EXPECT_EQ(step->allow_nearest, !step->exact_only);
    }
  }
  EXPECT_EQ(steps, 5);
}

TEST(Messages, APoseBatchBorrowsItsFrame) {
  for (const auto& [name, sample] : SampleMessages()) {
    const auto* batch = std::get_if<PoseBatch>(&sample);
    if (batch == nullptr || batch->avatars.empty()) continue;
    const auto frame = EncodeOrFail(sample);
    const auto decoded = Decode(frame, MessageType::kPoseBatch);
    ASSERT_TRUE(decoded);
    const auto& poses = std::get<PoseBatch>(*decoded).poses;
    EXPECT_GE(poses.data(), frame.data());
    EXPECT_LE(poses.data() + poses.size(), frame.data() + frame.size());
  }
}

}  // namespace
}  // namespace stridewire::protocol
