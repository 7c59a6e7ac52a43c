#include "stridewire/protocol/decode.h"

#include <bit>
#include <cstdint>

#include "codec_support.h"
#include "message_list.h"

namespace stridewire::protocol {

static_assert(std::endian::native == std::endian::little, "batches are read in place");

namespace {

template <typename Wire, typename T>
Expected<Message> Decode(std::span<const std::byte> payload) {
  flatbuffers::Verifier::Options options;
  options.max_depth = kMaxDepth;
  options.max_tables =
      static_cast<flatbuffers::uoffset_t>(IsBulk(T::kType) ? kMaxCrowdTables : kMaxFewTables);
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(payload.data());
  flatbuffers::Verifier verifier(bytes, payload.size(), options);
  if (!verifier.VerifyBuffer<Wire>(nullptr)) {
    return Fail(ErrorCode::kMalformed, "the payload is not a valid FlatBuffers message",
                std::string(MessageTypeName(T::kType)));
  }
  T message;
  Findings found;
  const FieldPath path{.name = MessageTypeName(T::kType)};
  Unpack(found, path, *flatbuffers::GetRoot<Wire>(bytes), message);
  if (found.ok()) CheckFields(found, path, message);
  if (Status status = found.Result(); !status) return std::unexpected(std::move(status.error()));
  return Message(std::move(message));
}

}  // namespace

Expected<Message> DecodeMessage(const FrameView& frame) {
  if (reinterpret_cast<std::uintptr_t>(frame.payload.data()) % kPayloadAlignment != 0) {
    return Fail(ErrorCode::kInvalidArgument, "the payload is not aligned to 8 bytes");
  }
  if (frame.payload.size() > MaxPayloadBytes(frame.type)) {
    return Fail(ErrorCode::kLimitExceeded, "the payload exceeds the limit of its message type",
                std::string(MessageTypeName(frame.type)),
                static_cast<std::int64_t>(frame.payload.size()));
  }
  switch (frame.type) {
#define STRIDEWIRE_CASE(Struct, Name, ...) \
  case MessageType::k##Name: return Decode<wire::Name, Struct>(frame.payload);
    STRIDEWIRE_MESSAGES(STRIDEWIRE_CASE)
#undef STRIDEWIRE_CASE
  }
  return Fail(ErrorCode::kUnsupported, "unknown message type", "frame.type",
              static_cast<std::int64_t>(frame.type));
}

}  // namespace stridewire::protocol
