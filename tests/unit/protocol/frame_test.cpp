#include "stridewire/protocol/frame.h"

#include <cstring>

#include "protocol_testing.h"

namespace stridewire::protocol {
namespace {

using HeaderBytes = std::array<std::byte, kFrameHeaderBytes>;

HeaderBytes Header(MessageType type, std::uint32_t payload_bytes) {
  HeaderBytes bytes;
  WriteFrameHeader({type, payload_bytes}, bytes);
  return bytes;
}

ErrorCode CodeOf(const HeaderBytes& bytes, Sender sender, const FrameLimits& limits = {}) {
  const auto header = ReadFrameHeader(bytes, sender, limits);
  EXPECT_FALSE(header);
  return header ? ErrorCode::kIo : header.error().code;
}

TEST(Frame, HeaderMatchesTheStandard) {
  const HeaderBytes bytes = Header(MessageType::kPoseBatch, 0x00123458);
  const std::array<int, 16> stated = {0x53, 0x57, 0x50, 0x1a, 1, 0, 67, 0,
                                      0x58, 0x34, 0x12, 0x00, 0, 0, 0,  0};
  for (std::size_t i = 0; i < stated.size(); ++i) {
    EXPECT_EQ(std::to_integer<int>(bytes[i]), stated[i]) << i;
  }
}

TEST(Frame, HeaderRoundTrips) {
  const auto header = ReadFrameHeader(Header(MessageType::kSpawn, 4096), Sender::kClient);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->type, MessageType::kSpawn);
  EXPECT_EQ(header->payload_bytes, 4096u);
}

TEST(Frame, ChecksEveryByteOfTheMagic) {
  for (std::size_t i = 0; i < 4; ++i) {
    HeaderBytes bytes = Header(MessageType::kPing, 8);
    bytes[i] ^= std::byte{1};
    EXPECT_EQ(CodeOf(bytes, Sender::kClient), ErrorCode::kMalformed);
  }
}

TEST(Frame, RejectsAnotherVersion) {
  for (std::size_t i = 4; i < 6; ++i) {
    HeaderBytes bytes = Header(MessageType::kPing, 8);
    bytes[i] ^= std::byte{2};
    EXPECT_EQ(CodeOf(bytes, Sender::kClient), ErrorCode::kVersionMismatch);
  }
}

TEST(Frame, RejectsAnUnknownType) {
  for (const int type : {0, 16, 31, 33, 63, 76, 0x100 + 10, 65535}) {
    const auto bytes = Header(static_cast<MessageType>(type), 8);
    EXPECT_EQ(CodeOf(bytes, Sender::kClient), ErrorCode::kUnsupported) << type;
    EXPECT_EQ(CodeOf(bytes, Sender::kServer), ErrorCode::kUnsupported) << type;
  }
}

TEST(Frame, RejectsTypesOfTheOtherDirection) {
  int known = 0;
  for (int i = 0; i < 256; ++i) {
    const auto type = static_cast<MessageType>(i);
    if (!IsKnown(type)) continue;
    ++known;
    const bool client = ReadFrameHeader(Header(type, 8), Sender::kClient).has_value();
    const bool server = ReadFrameHeader(Header(type, 8), Sender::kServer).has_value();
    EXPECT_EQ(client, i <= 32) << i;
    EXPECT_EQ(server, i >= 32) << i;
    const Sender wrong = client ? Sender::kServer : Sender::kClient;
    if (!client || !server) {
      EXPECT_EQ(CodeOf(Header(type, 8), wrong), ErrorCode::kMalformed);
    }
  }
  EXPECT_EQ(known, static_cast<int>(std::variant_size_v<Message>));
}

TEST(Frame, FlagsMustBeZero) {
  for (std::size_t i = 12; i < 16; ++i) {
    HeaderBytes bytes = Header(MessageType::kPing, 8);
    bytes[i] = std::byte{1};
    EXPECT_EQ(CodeOf(bytes, Sender::kClient), ErrorCode::kMalformed);
  }
}

TEST(Frame, LengthMustBeAMultipleOfEight) {
  for (const std::uint32_t length : {0u, 1u, 4u, 7u, 9u, 12u, 1001u}) {
    EXPECT_EQ(CodeOf(Header(MessageType::kPing, length), Sender::kClient), ErrorCode::kMalformed);
  }
}

TEST(Frame, LengthIsLimitedByItsType) {
  const auto takes = [](MessageType type, std::size_t cap, const FrameLimits& limits = {}) {
    const auto bytes = static_cast<std::uint32_t>(cap);
    EXPECT_TRUE(ReadFrameHeader(Header(type, bytes), SenderOf(type), limits));
    EXPECT_EQ(CodeOf(Header(type, bytes + 8), SenderOf(type), limits), ErrorCode::kLimitExceeded);
    EXPECT_EQ(CodeOf(Header(type, 0xfffffff8u), SenderOf(type), limits), ErrorCode::kLimitExceeded);
  };
  takes(MessageType::kHello, 16 << 10);
  takes(MessageType::kJoinWorld, 1 << 20);
  takes(MessageType::kWorldInfo, 1 << 20);
  takes(MessageType::kRequest, 16 << 20);
  takes(MessageType::kPoseBatch, 16 << 20);
  takes(MessageType::kPing, 256, {256, 4096});
  takes(MessageType::kRequest, 4096, {256, 4096});
  // Limits cannot exceed those of the standard.
  takes(MessageType::kPing, 1 << 20, {1u << 30, 1u << 30});
  takes(MessageType::kEvents, 16 << 20, {1u << 30, 1u << 30});
}

TEST(Frame, ParseFrameNeedsOneAlignedFrame) {
  auto frame = EncodeOrFail(Ping{1, 2.0});
  ASSERT_TRUE(ParseFrame(frame, Sender::kClient));
  const std::span<const std::byte> bytes = frame;
  EXPECT_EQ(ParseFrame(bytes.first(15), Sender::kClient).error().code, ErrorCode::kMalformed);
  EXPECT_EQ(ParseFrame({}, Sender::kClient).error().code, ErrorCode::kMalformed);
  EXPECT_EQ(ParseFrame(bytes.first(bytes.size() - 8), Sender::kClient).error().code,
            ErrorCode::kMalformed);
  frame.resize(frame.size() + 8);
  EXPECT_EQ(ParseFrame(frame, Sender::kClient).error().code, ErrorCode::kMalformed);
  EXPECT_EQ(ParseFrame(std::span<const std::byte>(frame).subspan(1), Sender::kClient).error().code,
            ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace stridewire::protocol
