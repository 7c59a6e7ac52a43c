#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "session/region_members.h"
#include "world/shard_messages.h"

namespace stridewire::server {

/// The subscriptions of a session, by the ids that its client has chosen.
///
/// Subscriptions to the same world and mode share batches. If one of them covers all avatars, the
/// session receives complete batches; otherwise it receives batches of exactly the avatars that any
/// of them selects. A subscription with a region must be the only one of its world. Its rings may
/// have different modes.
class Subscriptions {
 public:
  struct Subscription {
    WorldId world = 0;
    /// Mode of the poses. With a region, the mode beyond its rings.
    protocol::PoseMode mode = protocol::PoseMode::kFull;
    std::uint16_t every_n_ticks = 1;
    bool with_events = false;
    std::vector<AvatarId> avatars;  ///< Ids to observe. Empty: all avatars, or those of the region.
    std::optional<RegionMembers> region;
  };
  /// The part of a delivery that the session sends to its client.
  enum class Share : std::uint8_t { kNone, kAll, kSubset, kRegion };

  /// Returns the mode in which poses are sent if a client requests `mode` and `detail`. All other
  /// functions use sent modes.
  [[nodiscard]] static protocol::PoseMode SentMode(protocol::PoseMode mode,
                                                   protocol::PoseDetail detail);

  [[nodiscard]] bool Contains(protocol::SubscriptionId id) const { return all_.contains(id); }
  [[nodiscard]] std::size_t size() const { return all_.size(); }
  /// Returns the sum of the numbers of avatars that the subscriptions select.
  [[nodiscard]] std::size_t selected_count() const { return selected_count_; }

  /// Adds a subscription. `id` must be new.
  void Add(protocol::SubscriptionId id, Subscription&& subscription);
  /// Returns the removed subscription, or nullopt if `id` does not exist.
  std::optional<Subscription> Remove(protocol::SubscriptionId id);
  void RemoveWorld(WorldId world);
  /// Must be called if the client may have missed messages. Empty batches are then sent again, even
  /// if nothing has changed.
  void RepeatEmptyBatches();

  [[nodiscard]] bool WantsEvents(WorldId world) const;
  /// True if there is a subscription to this world.
  [[nodiscard]] bool ObservesWorld(WorldId world) const;
  [[nodiscard]] bool HasRegion(WorldId world) const;
  [[nodiscard]] std::size_t region_count() const;
  /// Replaces the region of a subscription. Members stay members while they are in the new region.
  /// Returns false if `id` does not exist, has no region, or has another world or another mode
  /// beyond its rings.
  [[nodiscard]] bool MoveRegion(protocol::SubscriptionId id, const protocol::Observe& moved,
                                double default_leave_m);

  /// True if any subscription needs these poses.
  [[nodiscard]] bool Observes(WorldId world, protocol::PoseMode mode) const {
    return channels_.contains({world, mode});
  }
  [[nodiscard]] SendInterval IntervalOf(WorldId world, protocol::PoseMode mode) const;
  /// Returns the ascending ids of the selected avatars. Empty if the session needs complete
  /// batches, a region or no poses.
  [[nodiscard]] std::span<const AvatarId> SelectedAvatars(WorldId world,
                                                          protocol::PoseMode mode) const;
  /// Returns a filter for the rings of this mode in the region of this world, or nullopt if there
  /// are none.
  [[nodiscard]] std::optional<RegionFilter> FilterOf(WorldId world, protocol::PoseMode mode) const;

  [[nodiscard]] Share ShareOf(const PoseDelivery& delivery) const;
  /// Returns the rows that the session sends of a delivery with Share::kSubset. They are valid
  /// until the next call of any function. Returns nullopt if no row has a pose and the previous
  /// batch was empty as well.
  [[nodiscard]] std::optional<std::span<const std::uint32_t>> PickRows(
      const PoseDelivery& delivery);
  /// Returns the region of this world if it has a ring of this mode, otherwise null.
  [[nodiscard]] RegionMembers* FindRegion(WorldId world, protocol::PoseMode mode);
  /// Updates the region for a delivery with Share::kRegion. The delivery must contain positions.
  [[nodiscard]] RegionMembers::Change UpdateRegion(const PoseDelivery& delivery);

 private:
  using Key = std::pair<WorldId, protocol::PoseMode>;
  /// The selected rows of one shard.
  struct ShardRows {
    protocol::PoseRows::Avatars avatars;  // The avatars for which `rows` is valid.
    std::vector<std::uint32_t> rows;
    bool was_empty = false;  // True if the last batch contained no poses.
  };
  /// All subscriptions of one world and mode together.
  struct Channel {
    SendInterval interval;
    std::vector<AvatarId> selected;  // Ascending ids; empty: all avatars.
    std::map<int, ShardRows> shards;
  };

  [[nodiscard]] static std::vector<protocol::PoseMode> ModesOf(const Subscription& subscription);
  /// Returns the interval in ticks at which a subscription needs these poses; 0: never.
  [[nodiscard]] static std::uint16_t IntervalOf(const Subscription& subscription, const Key& key);
  void UpdateChannel(const Key& key);
  void UpdateChannels(const Subscription& subscription);
  void UpdateSelectedCount();

  std::map<protocol::SubscriptionId, Subscription> all_;
  std::map<Key, Channel> channels_;
  std::size_t selected_count_ = 0;
};

}  // namespace stridewire::server
