#include <set>

#include "message_json.h"
#include "protocol_testing.h"
#include "sample_messages.h"

namespace stridewire::protocol {
namespace {

TEST(Messages, RoundTrip) {
  for (const SampleMessage& sample : SampleMessages()) {
    SCOPED_TRACE(sample.name);
    const auto frame = EncodeOrFail(sample.message);
    const auto decoded = Decode(frame, TypeOf(sample.message));
    ASSERT_TRUE(decoded) << Describe(decoded.error());
    EXPECT_TRUE(SameMessage(sample.message, *decoded));
    EXPECT_EQ(EncodeOrFail(*decoded), frame);
  }
}

TEST(Messages, RoundTripThroughJson) {
  for (const SampleMessage& sample : SampleMessages()) {
    if (std::holds_alternative<PoseBatch>(sample.message)) continue;
    SCOPED_TRACE(sample.name);
    EXPECT_TRUE(SameMessage(FromJson(ToJson(sample.message)), sample.message));
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
  for (const SampleMessage& sample : SampleMessages()) alternatives.insert(sample.message.index());
  EXPECT_EQ(alternatives.size(), std::variant_size_v<Message>);
}

TEST(Messages, AreAppendedToOneBuffer) {
  Encoder encoder;
  std::vector<std::byte> frames;
  std::size_t bytes = 0;
  for (const SampleMessage& sample : SampleMessages()) {
    EXPECT_EQ(frames.size() % kPayloadAlignment, 0u);
    ASSERT_TRUE(encoder.Encode(sample.message, frames));
    const auto alone = EncodeOrFail(sample.message);
    ASSERT_EQ(frames.size(), bytes + alone.size());
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(),
                           frames.begin() + static_cast<std::ptrdiff_t>(bytes)));
    bytes = frames.size();
  }
}

TEST(Messages, APoseBatchBorrowsItsFrame) {
  for (const SampleMessage& sample : SampleMessages()) {
    const auto* batch = std::get_if<PoseBatch>(&sample.message);
    if (batch == nullptr || batch->avatars.empty()) continue;
    const auto frame = EncodeOrFail(sample.message);
    const auto decoded = Decode(frame, MessageType::kPoseBatch);
    ASSERT_TRUE(decoded);
    const auto& poses = std::get<PoseBatch>(*decoded).poses;
    EXPECT_GE(poses.data(), frame.data());
    EXPECT_LE(poses.data() + poses.size(), frame.data() + frame.size());
  }
}

}  // namespace
}  // namespace stridewire::protocol
