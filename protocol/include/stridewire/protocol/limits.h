#pragma once

#include <cstddef>
#include <cstdint>

namespace stridewire::protocol {

/// Version of the protocol. Hello and Welcome must have it, else the connection is closed. It
/// changes if the meaning of messages changes, or the formulas by which client and server evaluate
/// movement records.
inline constexpr std::uint16_t kProtocolVersion = 1;

// Limits of messages. A receiver rejects a message that exceeds one with kLimitExceeded.

/// Payload of a Hello message.
inline constexpr std::size_t kMaxHelloBytes = std::size_t{16} << 10;
inline constexpr std::size_t kMaxControlBytes =
    std::size_t{1}  /// Payload of a small message (FrameLimits).
    << 20;
/// Payload of a bulk message (FrameLimits), such as PoseBatch.
inline constexpr std::size_t kMaxBulkBytes = std::size_t{16} << 20;
inline constexpr std::size_t kMaxItems = 65'536;  ///< Items, avatars or events per message.
/// Length of the name of a world, client, joint or layer.
inline constexpr std::size_t kMaxNameBytes = 64;
/// Length of the text of a Reply, Error or Goodbye.
inline constexpr std::size_t kMaxTextBytes = 1024;
inline constexpr std::size_t kMaxReasonBytes = 256;  ///< Length of the text of one item or event.
inline constexpr std::size_t kMaxAuthTokenBytes = 4096;
inline constexpr std::size_t kMinResumeTokenBytes = 16;
inline constexpr std::size_t kMaxResumeTokenBytes = 64;
inline constexpr std::size_t kMaxJoints = 256;
inline constexpr std::size_t kMaxEndSites = 256;
inline constexpr std::size_t kMaxParameters = 7;  ///< Parameters per event.
/// Number of parameter names; a name is 0 to 8.
inline constexpr std::uint8_t kParameterNames = 9;
/// Number of keytimes of an inspected movement.
inline constexpr std::size_t kMaxKeytimes = 9;
/// Number of weights of an inspected movement.
inline constexpr std::size_t kMaxWeights = 4096;
/// Number of queued requests in AvatarState.
inline constexpr std::size_t kMaxInspectedRequests = 16;
/// Number of landings of an inspected movement.
inline constexpr std::size_t kMaxLandings = 2;
/// Number of layers that an avatar plays.
inline constexpr std::size_t kMaxPlayingLayers = 4;
inline constexpr std::uint16_t kMaxTerrainColumns =
    1024;  ///< Columns, and rows, of a height field.
inline constexpr std::size_t kMaxTerrainBoxes = 65'536;
inline constexpr std::size_t kMaxWaypoints = 64;   ///< Number of waypoints of a walk.
inline constexpr std::size_t kMaxLayerNames = 64;  ///< Number of layers of a library.
inline constexpr std::size_t kMaxRateRings = 4;    ///< Number of rings of a region.
/// Size of the movement record of one avatar.
inline constexpr std::size_t kMaxRecordBytes = std::size_t{64} << 10;
/// Number of bytes in a LibraryPiece.
inline constexpr std::size_t kMaxPieceBytes = std::size_t{1} << 20;
inline constexpr std::size_t kMaxLibraryBytes = std::size_t{1} << 30;
inline constexpr std::uint16_t kMaxEveryNTicks = 3600;
inline constexpr std::uint16_t kMaxBatchParts = 1024;
inline constexpr std::uint32_t kReplyCache = 1024;  ///< Replies that a server stores per session.
inline constexpr int kMaxDepth = 4;                 ///< Nesting depth of tables.

}  // namespace stridewire::protocol
