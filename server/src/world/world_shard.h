#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "ops/metrics.h"
#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/pose_rows.h"
#include "world/encoded_pose_cache.h"
#include "world/pose_frames.h"
#include "world/shard_messages.h"
#include "world/tick_clock.h"
#include "world/world.h"

namespace stridewire::server {

/// Poses further from the origin than this cannot be sent quantised; spawning refuses them.
inline constexpr double kMaxSpawnM = 100'000.0;
inline constexpr double kMaxSpawnHeadingRad = 10'000.0;

/// The avatars of one world that live on one shard. Knows no socket and no thread: time is an
/// argument, and what it makes is taken from it.
///
/// An avatar takes about 8 KB and its queue (docs/SERVER.md, "Memory").
class WorldShard {
 public:
  /// Borrows budget and metrics. `scratch` is of the world's library and this thread's; null: one
  /// of its own.
  WorldShard(std::shared_ptr<World> world, int shard, int shard_count, int max_queue,
             const TickClock& clock, AvatarBudget& budget, ThreadMetrics& metrics,
             std::size_t max_bulk_bytes = protocol::kMaxBulkBytes,
             std::shared_ptr<PoseScratch> scratch = nullptr);
  ~WorldShard();
  WorldShard(const WorldShard&) = delete;
  WorldShard& operator=(const WorldShard&) = delete;

  /// Does a command at the beginning of `tick`.
  [[nodiscard]] CommandResult Execute(const WorldCommand& command, std::uint64_t tick);

  /// Goes on to `tick` in `steps` steps of one tick each. An avatar's time is counted in steps, so
  /// its poses do not depend on when ticks came.
  void Advance(std::uint64_t tick, int steps);

  void SetInterest(const Interest& interest);
  [[nodiscard]] bool WantsEvents(int shard) const;
  [[nodiscard]] bool WantsMovements(int shard) const;
  /// Whether a shard wants whole batches of `tick`, and whether it wants poses of avatars it names.
  struct Wish {
    bool whole = false;
    bool some = false;
  };
  [[nodiscard]] Wish WishOf(int shard, protocol::PoseMode mode, std::uint64_t tick) const;

  /// Events since this was last called, null if there were none.
  [[nodiscard]] std::shared_ptr<const std::vector<protocol::Event>> TakeEvents();

  /// The poses of `tick`: of all avatars and with a whole batch, or of those that are named. False
  /// when nobody would miss it: no poses, and none in the delivery before.
  [[nodiscard]] bool Encode(protocol::PoseMode mode, std::uint64_t tick, bool whole,
                            protocol::PoseBatchComposer& composer, PoseDelivery& delivery);

  /// What avatars began since this was last called, up to `tick`. False: nobody would miss it.
  [[nodiscard]] bool TakeMovements(std::uint64_t tick, MovementDelivery& delivery);

  /// The states of avatars after the last tick, of one at least and until there are `enough_bytes`.
  [[nodiscard]] StatesAnswer States(const StatesQuestion& question,
                                    protocol::Encoder& encoder) const;

  /// What an avatar is doing after `tick`, the answer to InspectAvatar.
  [[nodiscard]] protocol::AvatarState Inspect(AvatarId avatar, std::uint64_t tick,
                                              std::size_t max_site_bytes) const;

  [[nodiscard]] std::size_t avatar_count() const { return avatars_.size(); }
  [[nodiscard]] const World& world() const { return *world_; }
  /// The ground its avatars are on, null: flat at 0.
  [[nodiscard]] std::shared_ptr<const Terrain> terrain() const {
    return ground_ == nullptr ? nullptr : ground_->terrain;
  }
  [[nodiscard]] bool HasInterest() const;

 private:
  struct Entry {
    AvatarSimulation avatar;
    SessionId owner = 0;
    std::uint64_t spawn_tick = 0;
    EncodedPoseCache::Place ahead;
  };
  // What Encode reads of who is quiet.
  static void Prefetch(const Entry& entry) {
    entry.avatar.PrefetchTickState();
    PrefetchBytes(&entry.spawn_tick, sizeof(entry.spawn_tick) + sizeof(entry.ahead));
  }
  struct InOrder {
    AvatarId number;
    Entry* entry;
  };
  void Spawn(const WorldCommand& command, const SpawnPart& part, std::uint64_t tick,
             CommandResult& result);
  void Request(const RequestPart& part, std::uint64_t tick, CommandResult& result);
  void Remove(const RemovePart& part, std::uint64_t tick, CommandResult& result);
  void SetLayers(const LayerPart& part, CommandResult& result);
  void SetPlanting(const PlantingPart& part, CommandResult& result);
  void Cancel(const CancelPart& part, CommandResult& result);
  void Release(SessionId session, std::uint64_t tick);
  void ChangeTerrain(std::uint64_t tick);
  void AdvanceAvatars(std::uint64_t tick, int steps);
  std::span<const InOrder> AvatarsInOrder();
  std::span<const std::uint32_t> NamedRows(protocol::PoseMode mode);
  bool HasRegions(protocol::PoseMode mode) const;
  bool HasRegionsOfSeveral(protocol::PoseMode mode) const;
  void KeepPoses(std::span<const std::uint32_t> rows);
  void UpdatePoses(std::span<const std::uint32_t> rows);
  std::shared_ptr<const SpatialGrid> PlacesAt(std::uint64_t tick);
  std::span<const std::uint32_t> NamedAndNearRows(protocol::PoseMode mode,
                                                  const SpatialGrid& places);
  void TellMovements();
  [[nodiscard]] protocol::Movements EmptyMovements() const;
  [[nodiscard]] bool IsFull(const protocol::Movements& message) const;
  void Gone(AvatarId avatar);
  protocol::Event& AddEvent(protocol::EventType type, AvatarId avatar, std::uint64_t tick);

  std::shared_ptr<World> world_;
  int shard_;
  int max_queue_;
  TickClock clock_;
  AvatarBudget& budget_;
  ThreadMetrics& metrics_;
  EncodedPoseCache ahead_;             // before the avatars, whose places are in it
  std::map<AvatarId, Entry> avatars_;  // in order, so that batches and events are
  // The same for who goes through all of them, made anew when there are others.
  std::vector<InOrder> in_order_;
  std::vector<AvatarSimulation*> advancing_;
  std::vector<std::uint32_t>
      eventful_;  // rows to which something may have happened in the last step
  protocol::PoseRows::Avatars numbers_;
  std::vector<std::uint32_t> all_rows_;
  bool is_order_known_ = false;
  std::vector<Interest> interests_;  // by shard
  // By mode: rows of avatars that are named by any shard, worked out when they or the order change.
  std::array<std::vector<std::uint32_t>, kSentModes.size()> named_rows_;
  bool are_named_rows_known_ = false;
  std::vector<std::uint32_t> near_rows_;       // those last asked for, by any mode
  std::vector<std::uint8_t> is_near_;          // by row, all 0 between
  std::shared_ptr<const SpatialGrid> places_;  // of places_tick_
  std::uint64_t places_tick_ = 0;
  std::uint16_t max_every_ = 1;
  bool events_wanted_ = false;
  std::vector<protocol::Event> events_;
  bool movements_wanted_ = false;
  bool movement_places_wanted_ = false;
  bool last_step_had_avatars_ = false;
  std::uint64_t step_ = 0;  // of its avatars
  std::uint64_t tick_ = 0;  // to which they go on
  std::uint16_t more_steps_ = 0;
  std::size_t max_bulk_bytes_;
  std::vector<AvatarId> gone_;                  // since the last step
  std::vector<protocol::Movements> movements_;  // of steps not taken yet
  std::shared_ptr<const WorldTerrain> ground_;  // null: flat
  std::deque<TerrainPart> grounds_;             // from later ticks on
  std::vector<AvatarSimulation*> shown_;        // scratch
  // By mode.
  std::array<bool, kSentModes.size()> last_had_poses_{};
  std::array<RowsPool, kSentModes.size()> rows_;
};

}  // namespace stridewire::server
