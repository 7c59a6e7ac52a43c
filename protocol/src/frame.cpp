#include "stridewire/protocol/frame.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "message_list.h"

namespace stridewire::protocol {
namespace {

// Messages are little-endian and are read in place.
static_assert(std::endian::native == std::endian::little);

template <typename T>
T Load(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

}  // namespace

std::string_view MessageTypeName(MessageType type) {
  switch (type) {
#define STRIDEWIRE_CASE(Struct, Name, ...) \
  case MessageType::k##Name: return #Name;
    STRIDEWIRE_MESSAGES(STRIDEWIRE_CASE)
#undef STRIDEWIRE_CASE
  }
  return "unknown";
}

bool IsKnown(MessageType type) { return MessageTypeName(type) != "unknown"; }

namespace {

// Properties of a message type that the schema states.
struct Properties {
  bool from_client = false;
  bool from_server = false;
  bool is_bulk = false;
};

Properties PropertiesOf(MessageType type) {
  // NOLINTBEGIN(bugprone-branch-clone): several messages have the same properties.
  switch (type) {
#define STRIDEWIRE_CASE(Struct, Name, ...) \
  case MessageType::k##Name: return Properties{__VA_ARGS__};
    STRIDEWIRE_MESSAGES(STRIDEWIRE_CASE)
#undef STRIDEWIRE_CASE
  }
  // NOLINTEND(bugprone-branch-clone)
  return {};
}

}  // namespace

bool MaySend(Sender sender, MessageType type) {
  const Properties properties = PropertiesOf(type);
  return sender == Sender::kClient ? properties.from_client : properties.from_server;
}

bool IsBulk(MessageType type) { return PropertiesOf(type).is_bulk; }

std::size_t MaxPayloadBytes(MessageType type, const FrameLimits& limits) {
  if (IsBulk(type)) return std::min(limits.max_bulk_bytes, kMaxBulkBytes);
  const std::size_t control = std::min(limits.max_control_bytes, kMaxControlBytes);
  return type == MessageType::kHello ? std::min(control, kMaxHelloBytes) : control;
}

void WriteFrameHeader(const FrameHeader& header, std::span<std::byte, kFrameHeaderBytes> out) {
  const auto type = static_cast<std::uint16_t>(header.type);
  std::memcpy(out.data(), kFrameMagic.data(), 4);
  std::memcpy(out.data() + 4, &kFrameVersion, 2);
  std::memcpy(out.data() + 6, &type, 2);
  std::memcpy(out.data() + 8, &header.payload_bytes, 4);
  std::memset(out.data() + 12, 0, 4);
}

Expected<FrameHeader> ReadFrameHeader(std::span<const std::byte, kFrameHeaderBytes> bytes,
                                      Sender sender, const FrameLimits& limits) {
  if (!std::equal(kFrameMagic.begin(), kFrameMagic.end(), bytes.begin())) {
    return Fail(ErrorCode::kMalformed, "frame does not begin with the magic bytes", "frame.magic");
  }
  const auto version = Load<std::uint16_t>(bytes.data() + 4);
  if (version != kFrameVersion) {
    return Fail(ErrorCode::kVersionMismatch, "unknown frame version", "frame.version", version);
  }
  const auto type = static_cast<MessageType>(Load<std::uint16_t>(bytes.data() + 6));
  if (!IsKnown(type)) {
    return Fail(ErrorCode::kUnsupported, "unknown message type", "frame.type",
                static_cast<std::int64_t>(type));
  }
  if (!MaySend(sender, type)) {
    return Fail(ErrorCode::kMalformed, "this side may not send messages of this type", "frame.type",
                static_cast<std::int64_t>(type));
  }
  if (Load<std::uint32_t>(bytes.data() + 12) != 0) {
    return Fail(ErrorCode::kMalformed, "frame flags are not zero", "frame.flags");
  }
  const auto payload_bytes = Load<std::uint32_t>(bytes.data() + 8);
  if (payload_bytes > MaxPayloadBytes(type, limits)) {
    return Fail(ErrorCode::kLimitExceeded, "the payload exceeds the limit of its message type",
                "frame.payload_bytes", payload_bytes);
  }
  if (payload_bytes == 0 || payload_bytes % kPayloadAlignment != 0) {
    return Fail(ErrorCode::kMalformed, "payload length is not a positive multiple of 8",
                "frame.payload_bytes", payload_bytes);
  }
  return FrameHeader{type, payload_bytes};
}

Expected<FrameView> ParseFrame(std::span<const std::byte> bytes, Sender sender,
                               const FrameLimits& limits) {
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % kPayloadAlignment != 0) {
    return Fail(ErrorCode::kInvalidArgument, "frame does not begin on a multiple of 8 bytes");
  }
  if (bytes.size() < kFrameHeaderBytes) {
    return Fail(ErrorCode::kMalformed, "frame is shorter than its header",
                static_cast<std::int64_t>(bytes.size()));
  }
  const auto header = ReadFrameHeader(bytes.first<kFrameHeaderBytes>(), sender, limits);
  if (!header) return std::unexpected(header.error());
  if (bytes.size() != kFrameHeaderBytes + header->payload_bytes) {
    return Fail(ErrorCode::kMalformed, "the length of the frame differs from its header",
                "frame.payload_bytes", header->payload_bytes);
  }
  return FrameView{header->type, bytes.subspan(kFrameHeaderBytes)};
}

}  // namespace stridewire::protocol
