#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "stridewire/base/error.h"
#include "stridewire/protocol/limits.h"

namespace stridewire::protocol {

/// Message types as they stand in the frame header. Append only.
enum class MessageType : std::uint16_t {
  // Client to server.
  kHello = 1,
  kJoinWorld = 2,
  kLeaveWorld = 3,
  kSpawn = 4,
  kRemove = 5,
  kRequest = 6,
  kCancelQueue = 7,
  kObserve = 8,
  kStopObserving = 9,
  kPing = 10,
  kInspectAvatar = 11,
  kSetTerrain = 12,
  kSetLayers = 13,
  kSetPlanting = 14,
  kFetchLibrary = 15,
  // Both ways.
  kGoodbye = 32,
  // Server to client.
  kWelcome = 64,
  kWorldInfo = 65,
  kReply = 66,
  kPoseBatch = 67,
  kEvents = 68,
  kLagging = 69,
  kError = 70,
  kPong = 71,
  kAvatarState = 72,
  kWorldTerrain = 73,
  kMovements = 74,
  kLibraryPiece = 75,
};

/// Who sent it.
enum class Sender : std::uint8_t { kClient, kServer };

/// "Hello", "PoseBatch"; "unknown" for a number that is no type.
[[nodiscard]] std::string_view MessageTypeName(MessageType type);
[[nodiscard]] bool IsKnown(MessageType type);
[[nodiscard]] bool MaySend(Sender sender, MessageType type);

/// Messages that carry a crowd: they may be as large as FrameLimits::max_bulk_bytes.
[[nodiscard]] bool IsBulk(MessageType type);

/// Largest payloads to take or make. Lower them freely; the defaults are what the standard allows.
struct FrameLimits {
  std::size_t max_control_bytes = kMaxControlBytes;
  std::size_t max_bulk_bytes = kMaxBulkBytes;
};

/// Cap of a payload of this type. Hello is capped at kMaxHelloBytes as well.
[[nodiscard]] std::size_t MaxPayloadBytes(MessageType type, const FrameLimits& limits = {});

/// Frame header: 16 bytes, little-endian (STANDARD.md, "Frame").
///   0 magic "SWP\x1a"   4 u16 frame version   6 u16 type   8 u32 payload bytes   12 u32 flags = 0
/// The payload is a multiple of 8 bytes long (zeros at its end), so that every frame of a stream
/// begins on a multiple of 8.
inline constexpr std::size_t kFrameHeaderBytes = 16;
inline constexpr std::array<std::byte, 4> kFrameMagic = {std::byte{'S'}, std::byte{'W'},
                                                         std::byte{'P'}, std::byte{0x1a}};
inline constexpr std::uint16_t kFrameVersion = 1;
inline constexpr std::size_t kPayloadAlignment = 8;

struct FrameHeader {
  MessageType type = MessageType::kHello;
  std::uint32_t payload_bytes = 0;
};

/// A frame in somebody else's memory.
struct FrameView {
  MessageType type = MessageType::kHello;
  std::span<const std::byte> payload;  ///< Begins on a multiple of 8 bytes.
};

/// Writes a header. `out` is kFrameHeaderBytes long.
void WriteFrameHeader(const FrameHeader& header, std::span<std::byte, kFrameHeaderBytes> out);

/// Reads a header sent by `sender` and checks magic, version, type, direction, length and flags.
/// kMalformed, kVersionMismatch, kUnsupported (type), kLimitExceeded (length). After an error
/// nothing that follows can be trusted: the connection closes.
[[nodiscard]] Expected<FrameHeader> ReadFrameHeader(
    std::span<const std::byte, kFrameHeaderBytes> bytes, Sender sender,
    const FrameLimits& limits = {});

/// One whole frame, e.g. a WebSocket message: header and exactly its payload. `bytes` begins on a
/// multiple of 8 (kInvalidArgument otherwise) and must outlive the view.
[[nodiscard]] Expected<FrameView> ParseFrame(std::span<const std::byte> bytes, Sender sender,
                                             const FrameLimits& limits = {});

}  // namespace stridewire::protocol
