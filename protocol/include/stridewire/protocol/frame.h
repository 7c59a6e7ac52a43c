#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "stridewire/base/error.h"
#include "stridewire/protocol/limits.h"
#include "stridewire/protocol/message_type.h"

namespace stridewire::protocol {

/// Side that sent a frame.
enum class Sender : std::uint8_t { kClient, kServer };

/// Returns the name of a type, for example "PoseBatch", or "unknown".
[[nodiscard]] std::string_view MessageTypeName(MessageType type);
/// Returns whether the number is a message type.
[[nodiscard]] bool IsKnown(MessageType type);
/// Returns whether this side may send messages of this type.
[[nodiscard]] bool MaySend(Sender sender, MessageType type);

/// Returns whether messages of this type may be as large as FrameLimits::max_bulk_bytes, because
/// they can contain a terrain, a piece of a library or data of a whole crowd.
[[nodiscard]] bool IsBulk(MessageType type);

/// Limits of payload sizes in bytes. The defaults are those of STANDARD.md. A program may use
/// lower ones.
struct FrameLimits {
  std::size_t max_control_bytes = kMaxControlBytes;
  std::size_t max_bulk_bytes = kMaxBulkBytes;
};

/// Returns the maximum payload size of this type in bytes. Hello is also limited to kMaxHelloBytes.
[[nodiscard]] std::size_t MaxPayloadBytes(MessageType type, const FrameLimits& limits = {});

/// Size of the frame header in bytes. Its fields are little-endian (STANDARD.md, "Frame"):
///   0 magic "SWP\x1a"   4 u16 frame version   6 u16 type   8 u32 payload bytes   12 u32 flags = 0
/// Payloads are padded with zeros to a multiple of 8 bytes, so that every frame of a stream is
/// aligned to 8 bytes.
inline constexpr std::size_t kFrameHeaderBytes = 16;
inline constexpr std::array<std::byte, 4> kFrameMagic = {std::byte{'S'}, std::byte{'W'},
                                                         std::byte{'P'}, std::byte{0x1a}};
inline constexpr std::uint16_t kFrameVersion = 1;
inline constexpr std::size_t kPayloadAlignment = 8;

/// The variable fields of a frame header.
struct FrameHeader {
  MessageType type = MessageType::kHello;
  std::uint32_t payload_bytes = 0;
};

/// A frame whose payload is borrowed.
struct FrameView {
  MessageType type = MessageType::kHello;
  std::span<const std::byte> payload;  ///< Payload, aligned to 8 bytes.
};

/// Writes a frame header.
void WriteFrameHeader(const FrameHeader& header, std::span<std::byte, kFrameHeaderBytes> out);

/// Reads a frame header that `sender` sent. Fails with kMalformed (magic, direction, flags, or a
/// length that is 0 or not a multiple of 8), kVersionMismatch, kUnsupported (unknown type) or
/// kLimitExceeded (length). After an error the rest of the stream is invalid, so the caller must
/// close the connection.
[[nodiscard]] Expected<FrameHeader> ReadFrameHeader(
    std::span<const std::byte, kFrameHeaderBytes> bytes, Sender sender,
    const FrameLimits& limits = {});

/// Parses one whole frame, for example a WebSocket message. `bytes` must outlive the returned view.
/// Fails with the errors of ReadFrameHeader, with kMalformed if the size of the payload differs
/// from that in the header, and with kInvalidArgument if `bytes` is not aligned to 8 bytes.
[[nodiscard]] Expected<FrameView> ParseFrame(std::span<const std::byte> bytes, Sender sender,
                                             const FrameLimits& limits = {});

}  // namespace stridewire::protocol
