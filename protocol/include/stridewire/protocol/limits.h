#pragma once

#include <cstddef>
#include <cstdint>

namespace stridewire::protocol {

/// Versions of the messages this build speaks; Hello and Welcome agree on one.
inline constexpr std::uint16_t kProtocolMin = 1;
inline constexpr std::uint16_t kProtocolMax = 1;

/// Feature bits of Hello and Welcome: what both sides set may be used. Unknown bits are ignored.
inline constexpr std::uint64_t kFeatureResume = 1;        ///< Sessions outlive a connection.
inline constexpr std::uint64_t kFeatureEventReplay = 2;   ///< Events missed are sent again.
inline constexpr std::uint64_t kFeatureQuantised = 4;     ///< PoseMode::kQuantised.
inline constexpr std::uint64_t kFeatureInspect = 16;      ///< InspectAvatar, AvatarState.
inline constexpr std::uint64_t kFeatureTerrain = 32;      ///< SetTerrain, WorldTerrain.
inline constexpr std::uint64_t kFeatureFootprints = 64;   ///< Steps to a place (StepMovement::at).
inline constexpr std::uint64_t kFeatureWalks = 128;       ///< WalkMovement.
inline constexpr std::uint64_t kFeatureTakeovers = 256;   ///< RequestItem::interrupt.
inline constexpr std::uint64_t kFeatureLayers = 512;      ///< SetLayers, WorldInfo::layers.
inline constexpr std::uint64_t kFeatureRefusals = 1024;   ///< StepMovement::exact_only.
inline constexpr std::uint64_t kFeaturePlanting = 2048;   ///< SetPlanting.
inline constexpr std::uint64_t kFeatureCompact = 4096;    ///< PoseMode::kCompact.
inline constexpr std::uint64_t kFeatureDetail = 8192;     ///< Observe::detail.
inline constexpr std::uint64_t kFeatureRegions = 16'384;  ///< Observe::region, kEntered, kLeft.
/// PoseMode::kMovement, FetchLibrary. Both sides evaluate movements by the same formulas: when
/// these change, another bit. 8 stood for those before library format 3.
inline constexpr std::uint64_t kFeatureMovementMode = 32'768;
/// All features.
inline constexpr std::uint64_t kAllFeatures = 0xfff7;

// Limits of messages. A receiver rejects a message that exceeds one with kLimitExceeded.

inline constexpr std::size_t kMaxHelloBytes = std::size_t{16} << 10;  ///< Payload of Hello.
inline constexpr std::size_t kMaxControlBytes = std::size_t{1}
                                                << 20;               ///< Payload of small messages.
inline constexpr std::size_t kMaxBulkBytes = std::size_t{16} << 20;  ///< Payload of bulk messages.
inline constexpr std::size_t kMaxItems = 65'536;  ///< Items, avatars or events per message.
inline constexpr std::size_t kMaxNameBytes = 64;  ///< Names of worlds, clients, joints and layers.
inline constexpr std::size_t kMaxTextBytes = 1024;   ///< Text of a Reply, Error or Goodbye.
inline constexpr std::size_t kMaxReasonBytes = 256;  ///< Text of one item or event.
inline constexpr std::size_t kMaxAuthTokenBytes = 4096;
inline constexpr std::size_t kMinResumeTokenBytes = 16;
inline constexpr std::size_t kMaxResumeTokenBytes = 64;
inline constexpr std::size_t kMaxJoints = 256;
inline constexpr std::size_t kMaxEndSites = 256;
inline constexpr std::size_t kMaxParameters = 7;          ///< Parameters per event.
inline constexpr std::uint8_t kParameterNames = 9;        ///< Parameter names are 0 to 8.
inline constexpr std::size_t kMaxKeytimes = 9;            ///< Keytimes of an inspected movement.
inline constexpr std::size_t kMaxWeights = 4096;          ///< Weights of an inspected movement.
inline constexpr std::size_t kMaxInspectedRequests = 16;  ///< Queued requests in AvatarState.
inline constexpr std::size_t kMaxLandings = 2;            ///< Landings of an inspected movement.
inline constexpr std::size_t kMaxPlayingLayers = 4;       ///< Layers that an avatar plays.
inline constexpr std::uint16_t kMaxTerrainColumns =
    1024;  ///< Columns, and rows, of a height field.
inline constexpr std::size_t kMaxTerrainBoxes = 65'536;
inline constexpr std::size_t kMaxWaypoints = 64;   ///< Waypoints of a walk.
inline constexpr std::size_t kMaxLayerNames = 64;  ///< Layers of a library.
inline constexpr std::size_t kMaxRateRings = 4;    ///< Rings of a region.
/// Movement record of one avatar.
inline constexpr std::size_t kMaxRecordBytes = std::size_t{64} << 10;
inline constexpr std::size_t kMaxPieceBytes = std::size_t{1} << 20;  ///< Bytes of a LibraryPiece.
inline constexpr std::size_t kMaxLibraryBytes = std::size_t{1} << 30;
inline constexpr std::uint16_t kMaxEveryNTicks = 3600;
inline constexpr std::uint16_t kMaxBatchParts = 1024;
inline constexpr std::uint32_t kReplyCache = 1024;  ///< Replies that a server stores per session.
inline constexpr int kMaxDepth = 4;                 ///< Nesting depth of tables.

}  // namespace stridewire::protocol
