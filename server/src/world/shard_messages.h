#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/refusal.h"
#include "net/shared_frame.h"
#include "stridewire/protocol/messages.h"
#include "stridewire/protocol/pose_rows.h"
#include "world/spatial_grid.h"
#include "world/world.h"

/// The messages between the threads of the server: from shard to shard (ShardMessage), and between
/// the shards and the main thread (ServerMessage, ShardMessage). The receiver owns them.
/// Shard::Post and ServerThread::Post send them to another thread.
///
///   session's shard                      avatars' shard               main thread
///     | WorldCommand, InspectRequest,          |                           |
///     | StatesRequest, Interest -------------> |                           |
///     | <--- ShardOutbox, once per tick ------ |                           |
///     |                                        |                           |
///     | JoinRequest, LeaveNotice, TerrainChange,                           |
///     | SessionEnded, SessionRestored -----------------------------------> |
///     | <----- JoinResult, TerrainRefusal, WorldCommand (TerrainPart) ---- |
namespace stridewire::server {

/// The part of a command that concerns the avatars of one shard. `index` is the position of an item
/// in the client's command.
struct SpawnPart {
  struct Item {
    std::uint32_t index = 0;
    protocol::SpawnItem spawn;
  };
  std::vector<Item> items;
};
struct RequestPart {
  struct Item {
    std::uint32_t index = 0;
    protocol::RequestItem request;
  };
  std::vector<Item> items;
  std::uint32_t over_ticks = 1;  ///< Number of ticks over which starts are spread (StartTickOf).
};
struct LayerPart {
  struct Item {
    std::uint32_t index = 0;
    protocol::LayerItem layer;
  };
  std::vector<Item> items;
};
struct AvatarRef {
  std::uint32_t index = 0;
  AvatarId avatar = 0;
};
struct RemovePart {
  std::vector<AvatarRef> avatars;
};
struct CancelPart {
  std::vector<AvatarRef> avatars;
};
struct PlantingPart {
  std::vector<AvatarRef> avatars;
  bool enabled = true;
};
/// Removes the avatars that a session spawned, because it has ended or has left the world. Has no
/// effect in persistent worlds.
struct ReleasePart {};

/// Sets the terrain of all avatars. All shards apply it at the same tick.
struct TerrainPart {
  std::shared_ptr<const WorldTerrain> terrain;
  std::uint64_t tick = 0;
};

/// A command that a shard executes at its next tick.
struct WorldCommand {
  std::shared_ptr<World> world;
  int from_shard = 0;  ///< Shard of the session, which receives the result.
  SessionId session = 0;
  /// Sequence number of the command. 0: the session does not expect a result.
  protocol::Seq seq = 0;
  std::variant<SpawnPart, RequestPart, RemovePart, CancelPart, ReleasePart, TerrainPart, LayerPart,
               PlantingPart>
      part;
};

/// The result of a WorldCommand on one shard.
struct CommandResult {
  SessionId session = 0;
  protocol::Seq seq = 0;
  std::uint32_t accepted = 0;
  /// Items of the Reply that concern avatars of this shard.
  std::vector<protocol::ReplyItem> items;
};

/// Requests the state of one avatar after the next tick (protocol message InspectAvatar).
struct InspectRequest {
  std::shared_ptr<World> world;
  int from_shard = 0;  ///< The shard of the session.
  SessionId session = 0;
  std::uint64_t nonce = 0;
  AvatarId avatar = 0;
};
struct InspectResult {
  SessionId session = 0;
  protocol::AvatarState state;
};

/// Requests the states of avatars after the next tick, for a client that will receive their
/// movements. A shard answers with as many states as fit. The session then requests the rest.
struct StatesRequest {
  std::shared_ptr<World> world;
  int from_shard = 0;  ///< The shard of the session.
  SessionId session = 0;
  std::uint32_t nonce = 0;
  AvatarId first = 0;  ///< Smallest id whose state is sent.
  /// The shard stops after the state with which the total size exceeds this.
  std::size_t enough_bytes = 0;
  /// Ascending ids of the avatars whose states are requested; null: all avatars.
  std::shared_ptr<const std::vector<AvatarId>> avatars;
};
struct StatesResult {
  WorldId world = 0;
  int from_shard = 0;  ///< Shard that owns the avatars and sends this result.
  SessionId session = 0;
  std::uint32_t nonce = 0;
  AvatarId next = 0;  ///< `first` of the next request; 0: no avatars are left.
  SharedFrame frame;  ///< Encoded states. Null if there are none.
};

/// The modes in which poses are sent, in the order of their values.
inline constexpr std::array kSentModes{
    protocol::PoseMode::kFull, protocol::PoseMode::kQuantised, protocol::PoseMode::kCompact,
    protocol::PoseMode::kCompactReduced, protocol::PoseMode::kCompactRoot};
/// Returns the index of `mode` in kSentModes.
[[nodiscard]] constexpr std::size_t ModeIndex(protocol::PoseMode mode) {
  return static_cast<std::size_t>(mode) - (mode > protocol::PoseMode::kMovement ? 1 : 0);
}

/// A disc or ring on the ground, in which sessions need the poses of all avatars in one mode.
struct RegionFilter {
  double x = 0.0;
  double z = 0.0;
  double outer_m = 0.0;
  double inner_m = 0.0;  ///< Avatars at this distance or nearer are excluded. 0: none are excluded.
  /// True if other rings of the same region use other modes. Deliveries are then needed even if no
  /// avatar is in this ring, because the positions in them show which avatars have left the region.
  bool is_one_of_several = false;
  bool operator==(const RegionFilter&) const = default;
};

/// Intervals at which poses are sent, in ticks. Poses are sent in ticks whose number is a multiple
/// of the interval. 0: never.
struct SendInterval {
  std::uint16_t all = 0;     ///< Interval for sessions that observe all avatars.
  std::uint16_t subset = 0;  ///< Interval for sessions that observe selected avatars or a region.
  bool operator==(const SendInterval&) const = default;
};

/// The poses of a world that the sessions of one shard need in one mode.
struct PoseInterest {
  SendInterval interval;
  /// Ascending ids of the avatars that sessions have selected; null: none. Sessions that observe
  /// all avatars do not contribute.
  std::shared_ptr<const std::vector<AvatarId>> avatars;
  /// Regions that sessions observe; null: none.
  std::shared_ptr<const std::vector<RegionFilter>> regions;
};

/// Poses, movements and events that the sessions of one shard need from a world. Replaces the
/// previous Interest of this shard.
struct Interest {
  std::shared_ptr<World> world;
  int shard = 0;  ///< The shard of the sessions.
  std::array<PoseInterest, kSentModes.size()> poses;
  bool events = false;
  bool movements = false;
  bool movement_regions = false;  ///< True if sessions observe the movements in a region.
};

/// Poses of one world, shard, mode and tick.
struct PoseDelivery {
  WorldId world = 0;
  protocol::PoseMode mode = protocol::PoseMode::kFull;
  int from_shard = 0;
  std::uint64_t tick = 0;
  /// Number of poses in `parts` or, if it is empty, in `rows`.
  std::uint32_t avatar_count = 0;
  /// Frames of the batch of all avatars; empty if no session needs this batch in this tick.
  std::vector<SharedFrame> parts;
  /// The encoded poses from which sessions compose smaller batches. Contains at least the poses of
  /// selected avatars and regions.
  std::shared_ptr<const protocol::PoseRows> rows;
  /// Positions of all avatars; null if no session observes a region.
  std::shared_ptr<const SpatialGrid> grid;
};

/// Movements that started in one world, shard and tick. A late tick contains several steps.
struct MovementDelivery {
  WorldId world = 0;
  int from_shard = 0;
  std::uint64_t tick = 0;
  std::shared_ptr<const std::vector<protocol::Movements>> steps;
  /// The avatars of the shard and their positions after the tick; null if no session observes a
  /// region.
  protocol::PoseRows::Avatars avatars;
  std::shared_ptr<const SpatialGrid> grid;
};

/// Events of one world, shard and tick.
struct EventDelivery {
  WorldId world = 0;
  std::uint64_t tick = 0;
  std::shared_ptr<const std::vector<protocol::Event>> events;
};

/// Everything that one shard sends to another after a tick.
struct ShardOutbox {
  std::vector<CommandResult> results;
  std::vector<EventDelivery> events;
  std::vector<PoseDelivery> poses;
  std::vector<InspectResult> inspections;
  std::vector<MovementDelivery> movements;
  std::vector<StatesResult> states;  ///< Delivered after the movements of the same tick.
};

/// Requests a world from the main thread, which creates it if necessary.
struct JoinRequest {
  int from_shard = 0;
  SessionId session = 0;
  protocol::Seq seq = 0;
  std::string name;
};
struct JoinResult {
  SessionId session = 0;
  protocol::Seq seq = 0;
  Outcome<std::shared_ptr<World>> world;
};
/// A session has left a world.
struct LeaveNotice {
  WorldId world = 0;
};

/// Asks the main thread to validate and encode a terrain. On success, it sends a
/// TerrainPart to all shards. Otherwise, it sends a TerrainRefusal to `from_shard`.
struct TerrainChange {
  std::shared_ptr<World> world;
  int from_shard = 0;
  SessionId session = 0;
  protocol::Seq seq = 0;
  std::optional<protocol::TerrainInfo> terrain;  ///< The new terrain; nullopt: flat ground.
};
struct TerrainRefusal {
  SessionId session = 0;
  protocol::Seq seq = 0;
  Refusal refusal;
};

/// Identifies a session and its client. Fixed for the whole life of the session.
struct SessionIdentity {
  SessionId id = 0;
  std::vector<std::byte> token;  ///< Secret with which a client resumes the session.
  std::string address;
};
struct SessionEnded {
  SessionId session = 0;
};
/// Reports a new session with the identity of a session that ended while its client was
/// reconnecting.
struct SessionRestored {
  int shard = 0;
  SessionIdentity identity;
};

using ShardMessage = std::variant<WorldCommand, InspectRequest, StatesRequest, Interest,
                                  ShardOutbox, JoinResult, TerrainRefusal>;
using ServerMessage =
    std::variant<JoinRequest, LeaveNotice, TerrainChange, SessionEnded, SessionRestored>;

}  // namespace stridewire::server
