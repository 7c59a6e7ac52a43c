#pragma once

#include <vector>

#include "stridewire/protocol/messages.h"
#include "stridewire_generated.h"

namespace stridewire::protocol {

/// Appends header, the finished FlatBuffers message in `builder` and its padding to `frame`.
/// kLimitExceeded: longer than the type may be; `frame` is left as it was.
[[nodiscard]] Status AppendFrame(const flatbuffers::FlatBufferBuilder& builder, MessageType type,
                                 const FrameLimits& limits, std::vector<std::byte>& frame);

/// The same in parts, for a message of `size` bytes some of which are not in a builder: BeginFrame appends the header and makes
/// room for the rest, the caller appends the message, EndFrame its padding.
[[nodiscard]] Status BeginFrame(std::size_t size, MessageType type, const FrameLimits& limits,
                                std::vector<std::byte>& frame);
void EndFrame(std::size_t size, std::vector<std::byte>& frame);

/// Table, vtable, vector lengths and padding of a batch stay below this.
inline constexpr std::size_t kPoseBatchOverheadBytes = 128;

/// The table of a batch whose lists are in `builder` already.
[[nodiscard]] flatbuffers::Offset<wire::PoseBatch> BuildPoseBatch(
    flatbuffers::FlatBufferBuilder& builder, const PoseBatchInfo& info,
    flatbuffers::Offset<flatbuffers::Vector<std::uint32_t>> avatars,
    flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>> flags,
    flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>> poses);

/// The table of a batch; the spans are copied into `builder`.
[[nodiscard]] flatbuffers::Offset<wire::PoseBatch> BuildPoseBatch(
    flatbuffers::FlatBufferBuilder& builder, const PoseBatch& batch);

}  // namespace stridewire::protocol
