#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "ops/metrics.h"
#include "stridewire/protocol/pose_batch_encoder.h"
#include "stridewire/runtime/avatar.h"
#include "world/mail.h"
#include "world/tick_clock.h"
#include "world/world.h"

namespace stridewire::server {

/// Poses further from the origin than this cannot be sent quantised; spawning refuses them.
inline constexpr double kMaxSpawnM = 100'000.0;
inline constexpr double kMaxSpawnHeadingRad = 10'000.0;

/// The avatars of one world that live on one shard. Knows no socket and no thread: time is an
/// argument, and what it makes is taken from it.
///
/// An avatar takes about 10 KB and its queue (docs/SERVER.md, "Memory").
class WorldShard {
 public:
  /// Borrows budget and metrics.
  WorldShard(std::shared_ptr<World> world, int shard, int shard_count, int max_queue,
             const TickClock& clock, AvatarBudget& budget, ThreadMetrics& metrics);
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
  [[nodiscard]] bool WantsPoses(int shard, protocol::PoseMode mode, std::uint64_t tick) const;

  /// Events since this was last called, null if there were none.
  [[nodiscard]] std::shared_ptr<const std::vector<protocol::Event>> TakeEvents();

  /// The poses of `tick`. False when nobody would miss it: no avatars, and none in the batch
  /// before.
  [[nodiscard]] bool Encode(protocol::PoseMode mode, std::uint64_t tick,
                            protocol::PoseBatchEncoder& encoder, PoseDelivery& delivery);

  /// What an avatar is doing after `tick`, the answer to InspectAvatar.
  [[nodiscard]] protocol::AvatarState Inspect(AvatarNumber avatar, std::uint64_t tick,
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
    Avatar avatar;
    SessionId owner = 0;
    std::uint64_t spawn_tick = 0;
    double time_s = 0.0;  // avatar time, added up exactly as the avatar does
  };
  struct InOrder {
    AvatarNumber number;
    Entry* entry;
  };
  struct ShardInterest {
    std::array<std::uint16_t, 2> every{};  // by mode, 0: none
    bool events = false;
  };

  void Spawn(const WorldCommand& command, const SpawnPart& part, std::uint64_t tick,
             CommandResult& result);
  void Request(const RequestPart& part, std::uint64_t tick, CommandResult& result);
  void Remove(const RemovePart& part, std::uint64_t tick, CommandResult& result);
  void SetLayers(const LayerPart& part, CommandResult& result);
  void SetPlanting(const PlantingPart& part, CommandResult& result);
  void Cancel(const CancelPart& part, CommandResult& result);
  void Release(SessionId session, std::uint64_t tick);
  void ChangeGround(std::uint64_t tick);
  void AdvanceAvatars(std::uint64_t tick, int steps);
  std::span<const InOrder> AvatarsInOrder();
  protocol::Event& AddEvent(protocol::EventType type, AvatarNumber avatar, std::uint64_t tick);

  std::shared_ptr<World> world_;
  int shard_;
  int max_queue_;
  TickClock clock_;
  AvatarBudget& budget_;
  ThreadMetrics& metrics_;
  std::map<AvatarNumber, Entry> avatars_;  // in order, so that batches and events are
  // The same for who goes through all of them, made anew when there are others.
  std::vector<InOrder> in_order_;
  std::vector<Avatar*> advancing_;
  bool is_order_known_ = false;
  std::vector<ShardInterest> interests_;  // by shard
  std::uint16_t max_every_ = 1;
  bool events_wanted_ = false;
  std::vector<protocol::Event> events_;
  std::shared_ptr<const Ground> ground_;  // null: flat
  std::deque<GroundPart> grounds_;        // from later ticks on
  std::array<bool, 2> last_batch_had_avatars_{};
};

}  // namespace stridewire::server
