#include "stridewire/protocol/frame_reader.h"

#include <random>

#include "protocol_testing.h"
#include "test_vectors.h"

namespace stridewire::protocol {
namespace {

struct Taken {
  MessageType type;
  std::vector<std::byte> payload;
  bool operator==(const Taken&) const = default;
};

/// Sample frames of a server, and the stream that contains them.
struct Stream {
  std::vector<Taken> frames;
  std::vector<std::byte> bytes;

  explicit Stream(Sender sender) {
    for (const auto& [name, sample] : SampleMessages()) {
      const MessageType type = TypeOf(sample);
      if (!MaySend(sender, type)) continue;
      const auto frame = EncodeOrFail(sample);
      frames.push_back({type, {frame.begin() + kFrameHeaderBytes, frame.end()}});
      bytes.insert(bytes.end(), frame.begin(), frame.end());
    }
  }
};

void TakeAll(FrameReader& reader, std::span<const std::byte> bytes, std::vector<Taken>& taken) {
  for (;;) {
    auto next = reader.Next(bytes);
    ASSERT_TRUE(next) << Describe(next.error());
    if (!*next) break;
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>((*next)->payload.data()) % kPayloadAlignment, 0u);
    taken.push_back({(*next)->type, {(*next)->payload.begin(), (*next)->payload.end()}});
  }
  EXPECT_TRUE(bytes.empty());
}

std::array<std::byte, kFrameHeaderBytes> HeaderOf(MessageType type, std::size_t payload_bytes) {
  std::array<std::byte, kFrameHeaderBytes> bytes;
  WriteFrameHeader({type, static_cast<std::uint32_t>(payload_bytes)}, bytes);
  return bytes;
}

TEST(FrameReader, ReadsAStreamAtOnce) {
  for (const Sender sender : {Sender::kClient, Sender::kServer}) {
    const Stream stream(sender);
    FrameReader reader(sender);
    std::vector<Taken> taken;
    TakeAll(reader, stream.bytes, taken);
    EXPECT_EQ(taken, stream.frames);
    EXPECT_EQ(reader.capacity_bytes(), 0u) << "whole aligned frames are read where they lie";
  }
}

TEST(FrameReader, ReadsAStreamByteByByte) {
  const Stream stream(Sender::kServer);
  FrameReader reader(Sender::kServer);
  std::vector<Taken> taken;
  for (std::size_t i = 0; i < stream.bytes.size(); ++i) {
    // A separate copy of each byte, so that a sanitizer detects reads beyond it.
    const std::vector<std::byte> one(1, stream.bytes[i]);
    TakeAll(reader, one, taken);
  }
  EXPECT_EQ(taken, stream.frames);
}

TEST(FrameReader, ReadsAStreamInRandomPieces) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const Stream stream(Sender::kServer);
  for (int round = 0; round < 200; ++round) {
    FrameReader reader(Sender::kServer);
    std::vector<Taken> taken;
    std::span<const std::byte> rest = stream.bytes;
    const std::size_t longest = std::uniform_int_distribution<std::size_t>(1, 2000)(random);
    while (!rest.empty()) {
      const std::size_t count =
          std::min(rest.size(), std::uniform_int_distribution<std::size_t>(1, longest)(random));
      const std::vector<std::byte> piece(rest.begin(), rest.begin() + static_cast<long>(count));
      TakeAll(reader, piece, taken);
      rest = rest.subspan(count);
    }
    ASSERT_EQ(taken, stream.frames);
  }
}

TEST(FrameReader, ReadsUnalignedInput) {
  const Stream stream(Sender::kServer);
  std::vector<std::byte> shifted(stream.bytes.size() + 3);
  std::copy(stream.bytes.begin(), stream.bytes.end(), shifted.begin() + 3);
  FrameReader reader(Sender::kServer);
  std::vector<Taken> taken;
  TakeAll(reader, std::span<const std::byte>(shifted).subspan(3), taken);
  EXPECT_EQ(taken, stream.frames);
}

TEST(FrameReader, RepeatsAnError) {
  FrameReader reader(Sender::kClient);
  auto bad = HeaderOf(MessageType::kPing, 16);
  bad[0] = std::byte{0};
  for (std::size_t i = 0; i < bad.size(); ++i) {
    std::span<const std::byte> one = std::span(bad).subspan(i, 1);
    EXPECT_EQ(reader.Next(one).has_value(), i + 1 < bad.size());
  }
  const auto good = EncodeOrFail(Ping{1, 2.0});
  for (int i = 0; i < 3; ++i) {
    std::span<const std::byte> bytes = good;
    const auto next = reader.Next(bytes);
    ASSERT_FALSE(next);
    EXPECT_EQ(next.error().code, ErrorCode::kMalformed);
    EXPECT_EQ(next.error().where, "frame.magic");
  }
}

TEST(FrameReader, RejectsTypesThatThePeerMustNotSend) {
  FrameReader reader(Sender::kClient);
  const auto welcome = EncodeOrFail(Pong{1, 2.0, 3.0, 4});
  std::span<const std::byte> bytes = welcome;
  const auto next = reader.Next(bytes);
  ASSERT_FALSE(next);
  EXPECT_EQ(next.error().where, "frame.type");
}

TEST(FrameReader, DoesNotAllocateForAHeader) {
  FrameReader reader(Sender::kClient);
  const auto header = HeaderOf(MessageType::kRequest, kMaxBulkBytes);
  std::span<const std::byte> bytes = header;
  const auto next = reader.Next(bytes);
  ASSERT_TRUE(next);
  EXPECT_FALSE(*next);
  EXPECT_LE(reader.capacity_bytes(), 4096u);
}

TEST(FrameReader, MemoryGrowsWithReceivedBytes) {
  FrameReader reader(Sender::kClient);
  const auto header = HeaderOf(MessageType::kRequest, kMaxBulkBytes);
  std::span<const std::byte> bytes = header;
  ASSERT_TRUE(reader.Next(bytes));
  const std::vector<std::byte> piece(10'000);
  std::size_t arrived = header.size();
  for (;;) {
    bytes = piece;
    auto next = reader.Next(bytes);
    ASSERT_TRUE(next);
    arrived += piece.size() - bytes.size();
    ASSERT_LE(reader.capacity_bytes(), std::max<std::size_t>(4096, 2 * arrived));
    ASSERT_LE(reader.capacity_bytes(), kFrameHeaderBytes + kMaxBulkBytes);
    if (*next) break;
  }
  EXPECT_EQ(arrived, kFrameHeaderBytes + kMaxBulkBytes);
  // The buffer of a large frame is freed with the next frame.
  const auto ping = EncodeOrFail(Ping{1, 2.0});
  bytes = std::span<const std::byte>(ping).first(20);
  ASSERT_TRUE(reader.Next(bytes));
  EXPECT_LE(reader.capacity_bytes(), 4096u);
}

TEST(FrameReader, LimitsCanChangeBetweenFrames) {
  FrameReader reader(Sender::kClient, {64, 64});
  auto hello = EncodeOrFail(Ping{1, 2.0});
  std::span<const std::byte> bytes = hello;
  ASSERT_TRUE(reader.Next(bytes));
  reader.set_limits({});
  const auto header = HeaderOf(MessageType::kRequest, 1 << 20);
  bytes = header;
  EXPECT_TRUE(reader.Next(bytes));

  FrameReader strict(Sender::kClient, {64, 64});
  bytes = header;
  const auto next = strict.Next(bytes);
  ASSERT_FALSE(next);
  EXPECT_EQ(next.error().code, ErrorCode::kLimitExceeded);
}

}  // namespace
}  // namespace stridewire::protocol
