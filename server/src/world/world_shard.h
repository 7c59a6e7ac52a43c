#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "base/metrics.h"
#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/pose_rows.h"
#include "world/encoded_pose_cache.h"
#include "world/pose_frames.h"
#include "world/shard_messages.h"
#include "world/tick_clock.h"
#include "world/world.h"
#include "world/world_interest.h"

namespace stridewire::server {

/// Spawning rejects positions farther than this from the origin along any axis, in metres.
/// Quantised poses cannot represent positions that are much farther away.
inline constexpr double kMaxSpawnM = 100'000.0;
inline constexpr double kMaxSpawnHeadingRad = 10'000.0;

/// Parameters of a WorldShard. Borrows `budget` and `metrics`.
struct WorldShardDef {
  std::shared_ptr<World> world;
  int shard = 0;
  int shard_count = 1;
  /// Maximum number of waiting requests per avatar.
  int max_queue = 256;
  /// Largest payload of a Movements message.
  std::size_t max_bulk_bytes = protocol::kMaxBulkBytes;
  const TickClock& clock;  ///< Clock of the ticks; copied.
  AvatarBudget& budget;
  ThreadMetrics& metrics;
  /// Scratch memory for the world's library, which other worlds of this thread may share. If null,
  /// the WorldShard allocates its own.
  std::shared_ptr<PoseScratch> scratch;
};

/// The avatars of one world on one shard. It has no sockets and no threads; time is an argument,
/// and the caller fetches results. Not thread-safe.
///
/// docs/SERVER.md, "Memory and capacity", states the memory of an avatar.
class WorldShard {
 public:
  explicit WorldShard(WorldShardDef def);
  ~WorldShard();
  WorldShard(const WorldShard&) = delete;
  WorldShard& operator=(const WorldShard&) = delete;

  /// Executes a command at the beginning of `tick`.
  [[nodiscard]] CommandResult Execute(const WorldCommand& command, std::uint64_t tick);

  /// Advances all avatars by `steps` steps of one tick each; the last step ends at `tick`. The time
  /// of an avatar is counted in steps, so its poses do not depend on delayed ticks.
  void Advance(std::uint64_t tick, int steps);

  void SetInterest(const Interest& interest);
  [[nodiscard]] const WorldInterest& interest() const { return interest_; }

  /// Returns the events since the previous call, or null if there were none.
  [[nodiscard]] std::shared_ptr<const std::vector<protocol::Event>> TakeEvents();

  /// Encodes the poses of `tick` in `mode`: of all avatars, with a complete batch, if `all` is
  /// true; otherwise of selected avatars and regions. Returns false if no session needs the
  /// delivery, because neither it nor the previous one has poses.
  [[nodiscard]] bool Encode(protocol::PoseMode mode, std::uint64_t tick, bool all,
                            protocol::PoseBatchComposer& composer, PoseDelivery& delivery);

  /// Moves the movements that started since the previous call to `delivery`. Returns false if there
  /// is nothing to deliver.
  [[nodiscard]] bool TakeMovements(std::uint64_t tick, MovementDelivery& delivery);

  /// Encodes the states of avatars after the last tick. Stops after the state with which the size
  /// exceeds `request.enough_bytes`, or when the message is full.
  [[nodiscard]] StatesResult States(const StatesRequest& request, protocol::Encoder& encoder) const;

  /// Describes an avatar after `tick`, for InspectAvatar. Parameters of examples are omitted if
  /// they take more than `max_site_bytes`.
  [[nodiscard]] protocol::AvatarState Inspect(AvatarId avatar, std::uint64_t tick,
                                              std::size_t max_site_bytes) const;

  [[nodiscard]] std::size_t avatar_count() const { return avatars_.size(); }
  [[nodiscard]] const World& world() const { return *world_; }
  /// Returns the terrain that the avatars currently use. Null: flat ground at height 0.
  [[nodiscard]] std::shared_ptr<const Terrain> terrain() const {
    return terrain_ == nullptr ? nullptr : terrain_->terrain;
  }

 private:
  struct Entry {
    AvatarSimulation avatar;
    SessionId owner = 0;
    std::uint64_t placed_tick = 0;  // Tick of the spawn or of the last teleport.
    EncodedPoseCache::Slot poses;
  };
  // Prefetches the members that CachePoses reads if no event of the avatar is due.
  static void Prefetch(const Entry& entry) {
    entry.avatar.PrefetchTickState();
    PrefetchBytes(&entry.placed_tick, sizeof(entry.placed_tick) + sizeof(entry.poses));
  }
  struct OrderedAvatar {
    AvatarId id;
    Entry* entry;
  };

  // Commands and ticks, in world_shard.cpp.
  void Spawn(const WorldCommand& command, const SpawnPart& part, std::uint64_t tick,
             CommandResult& result);
  void Request(const RequestPart& part, std::uint64_t tick, CommandResult& result);
  void Remove(const RemovePart& part, std::uint64_t tick, CommandResult& result);
  void SetLayers(const LayerPart& part, CommandResult& result);
  void SetPlanting(const PlantingPart& part, CommandResult& result);
  void Cancel(const CancelPart& part, std::uint64_t tick, CommandResult& result);
  void Release(SessionId session, std::uint64_t tick);
  void ApplyTerrain(std::uint64_t tick);
  void AdvanceAvatars(std::uint64_t tick, int steps);
  // Returns all avatars in the order of their ids.
  std::span<const OrderedAvatar> OrderedAvatars();
  void RecordMovements();
  void RecordRemoval(AvatarId avatar);
  [[nodiscard]] protocol::Movements EmptyMovements() const;
  [[nodiscard]] bool IsFull(const protocol::Movements& message) const;
  protocol::Event& AddEvent(protocol::EventType type, AvatarId avatar, std::uint64_t tick);
  // Reports the requests that the last call on an avatar has dropped.
  void ReportDropped(AvatarId id, AvatarSimulation& avatar, std::uint64_t tick);
  void ReportDropped(std::uint64_t tick);

  // world_shard_poses.cpp: poses.
  std::span<const std::uint32_t> SelectedRows(protocol::PoseMode mode);
  std::span<const std::uint32_t> SelectedAndRegionRows(protocol::PoseMode mode,
                                                       const SpatialGrid& grid);
  // The values that Encode needs from an avatar whose pose is in the cache. They are copied because
  // reading all avatars a second time per tick would be slow.
  struct CachedPose {
    std::uint64_t placed_tick;
    std::uint32_t slot;
    bool is_standing;
  };
  // Encodes the poses of these rows into the cache, and sets `cached_poses_`.
  void CachePoses(std::span<const std::uint32_t> rows);
  // Updates AvatarSimulation::pose of the avatars in these rows.
  void EvaluatePoses(std::span<const std::uint32_t> rows);
  std::shared_ptr<const SpatialGrid> GridAt(std::uint64_t tick);

  std::shared_ptr<World> world_;
  const int shard_;
  const int max_queue_;
  const std::size_t max_bulk_bytes_;
  const TickClock clock_;
  AvatarBudget& budget_;
  ThreadMetrics& metrics_;
  EncodedPoseCache cache_;             // Must outlive avatars_, which own its slots.
  std::map<AvatarId, Entry> avatars_;  // Ordered, so that batches and events are ordered.

  // Arrays of all avatars in the order of avatars_. Rows are indices of these arrays. They are
  // rebuilt by OrderedAvatars after avatars were added or removed.
  bool is_order_valid_ = false;
  std::vector<OrderedAvatar> ordered_;
  std::vector<AvatarSimulation*> advancing_;
  protocol::PoseRows::Avatars ids_;
  std::vector<std::uint32_t> all_rows_;

  std::vector<std::uint32_t> eventful_;  // Rows that may have events after the last step.
  std::vector<protocol::Event> events_;
  struct Dropped {
    AvatarId avatar;
    DroppedRequest request;
  };
  std::deque<Dropped> dropped_;          // Dropped requests that are not reported yet.
  std::size_t dropped_events_left_ = 0;  // How many of dropped_ may still be reported in this tick.
  std::uint64_t step_ = 0;               // Number of steps since this object was created.
  std::uint64_t tick_ = 0;               // Tick of the current or last Advance.
  // Number of steps that are left in the current Advance.
  std::uint16_t steps_left_ = 0;
  std::shared_ptr<const WorldTerrain> terrain_;  // Terrain in use; null: flat ground.
  // Terrains that apply from later ticks on, ordered by tick.
  std::deque<TerrainPart> next_terrains_;

  // Movements.
  bool last_step_had_avatars_ = false;
  std::vector<AvatarId> removed_;               // Avatars that were removed since the last step.
  std::vector<protocol::Movements> movements_;  // Movements since the last TakeMovements.

  // Poses.
  WorldInterest interest_;
  bool are_selected_rows_valid_ = false;
  std::array<std::vector<std::uint32_t>, kSentModes.size()> selected_rows_;  // by mode
  std::array<bool, kSentModes.size()> last_had_poses_{};                     // by mode
  std::array<RowsPool, kSentModes.size()> rows_;                             // by mode
  std::vector<CachedPose> cached_poses_;  // [i]: pose of the i-th row in the last CachePoses call.
  // Positions of the avatars at grid_tick_.
  std::shared_ptr<const SpatialGrid> grid_;
  std::uint64_t grid_tick_ = 0;
  // Scratch memory.
  std::vector<std::uint32_t> picked_rows_;
  std::vector<std::uint8_t> is_picked_;  // Flags by row; all 0 between calls.
  std::vector<AvatarSimulation*> evaluated_;
};

}  // namespace stridewire::server
