#pragma once

#include <vector>

#include "stridewire/protocol/messages.h"
#include "stridewire_generated.h"

namespace stridewire::protocol {

/// Appends a header, the finished FlatBuffers message in `builder` and its padding to `frame`.
/// Fails with kLimitExceeded if the message exceeds the limit of its type, and then leaves `frame`
/// unchanged.
[[nodiscard]] Status AppendFrame(const flatbuffers::FlatBufferBuilder& builder, MessageType type,
                                 const FrameLimits& limits, std::vector<std::byte>& frame);

/// Same as AppendFrame for a message of `size` bytes that is not completely in a builder.
/// BeginFrame appends the header and reserves memory. Then the caller appends the message, and
/// EndFrame appends the padding.
[[nodiscard]] Status BeginFrame(std::size_t size, MessageType type, const FrameLimits& limits,
                                std::vector<std::byte>& frame);
void EndFrame(std::size_t size, std::vector<std::byte>& frame);

/// Upper bound for the size of a batch without its lists: table, vtable, vector lengths and
/// padding.
inline constexpr std::size_t kPoseBatchOverheadBytes = 128;

/// Builds the table of a batch whose lists are already in `builder`.
[[nodiscard]] flatbuffers::Offset<wire::PoseBatch> BuildPoseBatch(
    flatbuffers::FlatBufferBuilder& builder, const PoseBatchInfo& info,
    flatbuffers::Offset<flatbuffers::Vector<std::uint32_t>> avatars,
    flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>> flags,
    flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>> poses);

}  // namespace stridewire::protocol
