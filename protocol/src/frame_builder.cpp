#include "frame_builder.h"

namespace stridewire::protocol {

namespace {

std::size_t PaddingOf(std::size_t size) {
  return (kPayloadAlignment - size % kPayloadAlignment) % kPayloadAlignment;
}

}  // namespace

Status BeginFrame(std::size_t size, MessageType type, const FrameLimits& limits,
                  std::vector<std::byte>& frame) {
  const std::size_t padding = PaddingOf(size);
  if (size + padding > MaxPayloadBytes(type, limits)) {
    return Fail(ErrorCode::kLimitExceeded, "the payload exceeds the limit of its message type",
                std::string(MessageTypeName(type)), static_cast<std::int64_t>(size + padding));
  }
  std::array<std::byte, kFrameHeaderBytes> header;
  WriteFrameHeader({type, static_cast<std::uint32_t>(size + padding)}, header);
  frame.reserve(frame.size() + header.size() + size + padding);
  frame.insert(frame.end(), header.begin(), header.end());
  return {};
}

void EndFrame(std::size_t size, std::vector<std::byte>& frame) {
  frame.insert(frame.end(), PaddingOf(size), std::byte{0});
}

Status AppendFrame(const flatbuffers::FlatBufferBuilder& builder, MessageType type,
                   const FrameLimits& limits, std::vector<std::byte>& frame) {
  const std::size_t size = builder.GetSize();
  if (const Status begun = BeginFrame(size, type, limits, frame); !begun) return begun;
  const auto* payload = reinterpret_cast<const std::byte*>(builder.GetBufferPointer());
  frame.insert(frame.end(), payload, payload + size);
  EndFrame(size, frame);
  return {};
}

flatbuffers::Offset<wire::PoseBatch> BuildPoseBatch(
    flatbuffers::FlatBufferBuilder& builder, const PoseBatchInfo& info,
    flatbuffers::Offset<flatbuffers::Vector<std::uint32_t>> avatars,
    flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>> flags,
    flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>> poses) {
  return wire::CreatePoseBatch(builder, info.world, info.shard, info.part, info.parts, info.tick,
                               info.server_time_s, static_cast<wire::PoseMode>(info.mode),
                               info.joint_count, avatars, flags, poses, info.is_partial);
}

}  // namespace stridewire::protocol
