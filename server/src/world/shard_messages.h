#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "net/shared_frame.h"
#include "stridewire/protocol/messages.h"
#include "stridewire/protocol/pose_rows.h"
#include "world/spatial_grid.h"
#include "world/world.h"

/// What shards send each other. Values only; the receiver owns what it gets.
namespace stridewire::server {

/// Items of a command with their position in it.
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
  std::uint32_t over_ticks = 1;  ///< What begins from a stand is spread over, by StartTickOf.
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
/// Removes what a session spawned: it has ended, or left the world.
struct ReleasePart {};

/// Another ground for all avatars, on all shards from the same tick on.
struct TerrainPart {
  std::shared_ptr<const WorldTerrain> ground;
  std::uint64_t tick = 0;
};

/// What a shard has to do for a session at its next tick.
struct WorldCommand {
  std::shared_ptr<World> world;
  int from_shard = 0;  ///< The session's shard.
  SessionId session = 0;
  protocol::Seq seq = 0;  ///< 0: no answer is wanted.
  std::variant<SpawnPart, RequestPart, RemovePart, CancelPart, ReleasePart, TerrainPart, LayerPart,
               PlantingPart>
      part;
};

/// A SetTerrain that is on its way to be made a ground of.
struct TerrainChange {
  std::shared_ptr<World> world;
  int from_shard = 0;  ///< The session's shard.
  SessionId session = 0;
  protocol::Seq seq = 0;
  std::optional<protocol::TerrainInfo> terrain;
};

/// What came of it on one shard.
struct CommandResult {
  SessionId session = 0;
  protocol::Seq seq = 0;
  std::uint32_t accepted = 0;
  std::vector<protocol::ReplyItem> items;  ///< As in Reply, of this shard's items.
};

/// A session's question what an avatar is doing, answered after the next tick.
struct Inspection {
  std::shared_ptr<World> world;
  int from_shard = 0;  ///< The session's shard.
  SessionId session = 0;
  std::uint64_t nonce = 0;
  AvatarId avatar = 0;
};
struct InspectionResult {
  SessionId session = 0;
  protocol::AvatarState state;
};

/// A session's question for the states of avatars it is to be told the movements of: some, from a number on, after the
/// next tick.
struct StatesQuestion {
  std::shared_ptr<World> world;
  int from_shard = 0;  ///< The session's shard.
  SessionId session = 0;
  std::uint32_t nonce = 0;
  AvatarId first = 0;
  std::size_t enough_bytes = 0;                        ///< Of states; the last may go beyond.
  std::shared_ptr<const std::vector<AvatarId>> named;  ///< Whose, growing; null: all.
};
struct StatesAnswer {
  WorldId world = 0;
  int from_shard = 0;  ///< The avatars'.
  SessionId session = 0;
  std::uint32_t nonce = 0;
  AvatarId next = 0;  ///< Where to go on; 0: these were all.
  SharedFrame frame;  ///< Null: none.
};

/// Modes in which poses are sent, in the order of their numbers.
inline constexpr std::array kSentModes{
    protocol::PoseMode::kFull, protocol::PoseMode::kQuantised, protocol::PoseMode::kCompact,
    protocol::PoseMode::kCompactFewer, protocol::PoseMode::kCompactRoot};
/// A mode's place among them.
[[nodiscard]] constexpr std::size_t ModeIndex(protocol::PoseMode mode) {
  return static_cast<std::size_t>(mode) - (mode > protocol::PoseMode::kMovement ? 1 : 0);
}

/// A circle or ring on the ground whose avatars are of interest.
struct RegionFilter {
  double x = 0.0;
  double z = 0.0;
  double reach_m = 0.0;
  double beyond_m = 0.0;  ///< Nearer than this or just as far they are not, unless it is 0.
  /// Others of its session's are of other modes. Its deliveries come even with nobody's pose: who was in one of those may
  /// have left, which only places tell.
  bool is_one_of_several = false;
  bool operator==(const RegionFilter&) const = default;
};

/// What the sessions of a shard want of the poses of a world in one mode.
struct PoseInterest {
  /// Of the ticks wanted those that this divides, 0: none.
  struct Every {
    std::uint16_t whole = 0;  ///< By sessions that want all avatars.
    std::uint16_t some = 0;   ///< By sessions that name theirs or have a region.
    bool operator==(const Every&) const = default;
  };
  Every every;
  /// Avatars named by any session, growing; null: none. Of who wants all there are none in it.
  std::shared_ptr<const std::vector<AvatarId>> named;
  /// Regions that any session observes; null: none.
  std::shared_ptr<const std::vector<RegionFilter>> regions;
};

/// What the sessions of a shard want of a world; replaces what that shard said before.
struct Interest {
  std::shared_ptr<World> world;
  int shard = 0;  ///< Whose.
  std::array<PoseInterest, kSentModes.size()> poses;
  bool events = false;
  bool movements = false;
  bool movement_places = false;  ///< Some of them are about regions.
};

/// Poses of one world, shard, mode and tick.
struct PoseDelivery {
  WorldId world = 0;
  protocol::PoseMode mode = protocol::PoseMode::kFull;
  int from_shard = 0;
  std::uint64_t tick = 0;
  std::uint32_t avatar_count = 0;  ///< In `parts`.
  std::vector<SharedFrame> parts;  ///< A whole batch; none if nobody wants one.
  /// What batches with some of them are made of: at least those that are named or in a region.
  std::shared_ptr<const protocol::PoseRows> rows;
  /// Where all of them are; null: nobody has a region.
  std::shared_ptr<const SpatialGrid> places;
};

/// What the avatars of one world and shard began in a tick, step by step.
struct MovementDelivery {
  WorldId world = 0;
  int from_shard = 0;
  std::uint64_t tick = 0;
  std::shared_ptr<const std::vector<protocol::Movements>> steps;
  /// Whose, and where they are after it; null: nobody has a region.
  protocol::PoseRows::Avatars avatars;
  std::shared_ptr<const SpatialGrid> places;
};

/// Events of one world, shard and tick.
struct EventDelivery {
  WorldId world = 0;
  std::uint64_t tick = 0;
  std::shared_ptr<const std::vector<protocol::Event>> events;
};

/// All that one shard has for another after a tick; one post.
struct ShardOutbox {
  std::vector<CommandResult> results;
  std::vector<EventDelivery> events;
  std::vector<PoseDelivery> poses;
  std::vector<InspectionResult> inspections;
  std::vector<MovementDelivery> movements;
  std::vector<StatesAnswer> states;  ///< After the movements of the same tick.

  [[nodiscard]] bool empty() const {
    return results.empty() && events.empty() && poses.empty() && inspections.empty() &&
           movements.empty() && states.empty();
  }
};

}  // namespace stridewire::server
