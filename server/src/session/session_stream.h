#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "session/event_replay.h"
#include "session/movement_feed.h"
#include "session/session_context.h"
#include "session/subscriptions.h"

namespace stridewire::server {

/// The frames of one MovementDelivery. They are encoded once, when the first session needs them.
class SharedMovements {
 public:
  SharedMovements(const MovementDelivery& delivery, protocol::Encoder& encoder)
      : delivery_(delivery), encoder_(encoder) {}
  [[nodiscard]] const MovementDelivery& delivery() const { return delivery_; }
  /// Returns one frame per step, with all avatars.
  [[nodiscard]] const std::vector<SharedFrame>& frames();
  /// Returns the frame of `empty`, which is the message of step `i` without avatars.
  [[nodiscard]] const SharedFrame& EmptyFrame(std::size_t i, const protocol::Movements& empty);

 private:
  const MovementDelivery& delivery_;
  protocol::Encoder& encoder_;
  std::vector<SharedFrame> frames_;
  std::vector<SharedFrame> empty_frames_;  // Null until the frame is needed.
};

/// One PoseDelivery and the batches that sessions compose from it.
class SharedPoses {
 public:
  SharedPoses(const PoseDelivery& delivery, protocol::PoseBatchComposer& composer,
              ThreadMetrics& metrics)
      : delivery_(delivery), composer_(composer), metrics_(metrics) {}
  [[nodiscard]] const PoseDelivery& delivery() const { return delivery_; }
  /// Composes a batch of the given rows.
  [[nodiscard]] PoseDelivery Compose(std::span<const std::uint32_t> rows, bool is_partial);
  /// Composes a partial batch. Sessions that need the same rows share the batch.
  [[nodiscard]] const PoseDelivery& ComposeShared(std::span<const std::uint32_t> rows);

 private:
  const PoseDelivery& delivery_;
  protocol::PoseBatchComposer& composer_;
  ThreadMetrics& metrics_;
  struct RowsHash {
    std::size_t operator()(const std::vector<std::uint32_t>& rows) const {
      return std::hash<std::string_view>()(
          {reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof(rows[0])});
    }
  };
  std::unordered_map<std::vector<std::uint32_t>, PoseDelivery, RowsHash> shared_;
};

/// The part of a session that sends poses, movements, events and terrain to the client, according
/// to its subscriptions.
class SessionStream {
 public:
  explicit SessionStream(SessionContext& context);

  // The following functions return which data of a world the session needs. Without a connection,
  // it needs only events, which are stored for the client.
  [[nodiscard]] bool WantsEvents(WorldId world) const;
  [[nodiscard]] bool WantsMovements(WorldId world) const {
    return context_.connection != nullptr &&
           subscriptions_.Observes(world, protocol::PoseMode::kMovement);
  }
  /// True if the session needs movements of a region, and therefore positions.
  [[nodiscard]] bool WantsMovementRegions(WorldId world) const {
    return WantsMovements(world) && subscriptions_.HasRegion(world);
  }
  [[nodiscard]] SendInterval IntervalOf(WorldId world, protocol::PoseMode mode) const;
  [[nodiscard]] std::span<const AvatarId> SelectedAvatars(WorldId world,
                                                          protocol::PoseMode mode) const;
  [[nodiscard]] std::optional<RegionFilter> FilterOf(WorldId world, protocol::PoseMode mode) const;

  [[nodiscard]] Subscriptions& subscriptions() { return subscriptions_; }
  [[nodiscard]] const Subscriptions& subscriptions() const { return subscriptions_; }

  void OnPoses(SharedPoses& poses);
  void OnMovements(SharedMovements& movements);
  void OnStates(const StatesResult& result);
  void OnEvents(const EventDelivery& delivery);
  void OnTerrain(WorldId world, const SharedFrame& frame);

  /// Continues after a new connection has been set. Sends stored events after message number
  /// `last_events_number`, and starts all movement feeds from new states.
  void Resume(std::uint64_t last_events_number);
  /// Stops everything that concerns a world and drops its waiting frames.
  void LeaveWorld(WorldId world);
  /// Removes a subscription and drops waiting frames that are no longer needed. Returns nullopt if
  /// `id` does not exist.
  std::optional<WorldId> RemoveSubscription(protocol::SubscriptionId id);

  /// Applies changed subscriptions to the movement feeds of a world.
  void UpdateMovementFeeds(const std::shared_ptr<World>& world);
  /// While the send queue has room for movements, requests the states that movement feeds need.
  /// Restarts lost feeds if the queue contains no movements.
  void RequestStates();
  /// Sends the terrain of a world. If none was ever set, sends flat ground if `even_if_flat`,
  /// otherwise nothing.
  void SendTerrain(const World& world, bool even_if_flat);
  /// Sends Lagging if batches or events were dropped since it was last sent.
  void SendLagging(Membership& membership);

 private:
  void EndMovementFeeds(WorldId world);
  void SendMovements(WorldId world, int shard, MovementFeed& feed, const SharedFrame& frame,
                     double wait_s);
  /// Sends `frames`, which contain poses of `delivery`.
  void SendPoses(const PoseDelivery& delivery, std::vector<SharedFrame> frames);
  /// Returns how long batches of a tick may wait for those of other shards, in seconds. 0: they do
  /// not wait.
  [[nodiscard]] double GatherTime() const;
  /// Call it after a batch that may wait was passed to the connection. Sends all batches of the
  /// tick once those of all shards have arrived.
  void OnGathered(std::uint64_t tick, int shard);
  void SendRegionChange(WorldId world, std::uint64_t tick, const RegionMembers::Change& change);
  /// Numbers a message, sends it if the client is connected, and stores it in event_replay_. If the
  /// send queue is full, drops the message instead. Returns how many events were dropped, including
  /// stored events that event_replay_ has dropped before they were sent.
  std::uint64_t SendEvents(protocol::Events&& message);
  void CountDroppedEvents(WorldId world, std::uint64_t events);
  void CountDroppedBatches(WorldId world, std::uint64_t batches);

  SessionContext& context_;
  Subscriptions subscriptions_;
  // Feeds by world and by the avatars' shard.
  std::map<std::pair<WorldId, int>, MovementFeed> movement_feeds_;
  std::uint32_t states_nonce_ = 0;
  std::uint64_t gathered_tick_ = 0;  // Newest tick with batches that were passed on.
  std::vector<bool> gathered_;       // [shard]: whether it has sent a batch of this tick.
  EventReplay event_replay_;
  std::uint64_t events_number_ = 0;  // Number of the last Events message.
};

}  // namespace stridewire::server
