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

/// What a session watches, by the numbers its client chose.
///
/// Subscriptions of one world and mode share batches. If one of them is about all avatars, the session gets
/// whole batches, otherwise such as hold exactly those that any of them names. A region is the only one of its world, and
/// about as many modes as its rings have details.
class Subscriptions {
 public:
  struct Subscription {
    WorldId world = 0;
    protocol::PoseMode mode = protocol::PoseMode::kFull;  ///< Of a region: beyond its rings.
    std::uint16_t every_n_ticks = 1;
    bool with_events = false;
    std::vector<AvatarId> avatars;  ///< Empty: all, or those of the region.
    std::optional<RegionMembers> region;
  };
  enum class Share : std::uint8_t { kNone, kWhole, kSome, kRegion };

  /// Whether quantised poses, those subscribed to already as well, are sent as compact ones, and of those some with
  /// less detail.
  void SetCompact(bool is_compact, bool has_detail);
  /// The mode in which what is asked for is sent: that of everything here. Detail that was not agreed on is all.
  [[nodiscard]] protocol::PoseMode SentMode(protocol::PoseMode asked,
                                            protocol::PoseDetail detail) const;

  /// Whether poses are sent in any detail asked for.
  [[nodiscard]] bool has_detail() const { return is_compact_ && has_detail_; }

  [[nodiscard]] bool Contains(protocol::SubscriptionId id) const { return all_.contains(id); }
  [[nodiscard]] std::size_t size() const { return all_.size(); }
  /// Sum over all of how many avatars each names.
  [[nodiscard]] std::size_t named_count() const { return named_count_; }

  void Add(protocol::SubscriptionId id, Subscription&& subscription);
  /// Returns what it was; empty: there is none of that number.
  std::optional<Subscription> Remove(protocol::SubscriptionId id);
  void RemoveWorld(WorldId world);
  /// The client may have missed what it was sent: what is empty is told anew.
  void TellAnew();

  [[nodiscard]] bool WithEvents(WorldId world) const;
  /// Some subscription is about that world, or some region.
  [[nodiscard]] bool WatchesWorld(WorldId world) const;
  [[nodiscard]] bool HasRegion(WorldId world) const;
  [[nodiscard]] std::size_t region_count() const;
  /// Gives a region another place; the members stay as long as that one has them. False: `id` is no region of that
  /// world and, beyond its rings, mode.
  [[nodiscard]] bool MoveRegion(protocol::SubscriptionId id, const protocol::Observe& moved,
                                double leave_m);

  /// Some subscription is about these poses.
  [[nodiscard]] bool Watches(WorldId world, protocol::PoseMode mode) const {
    return watches_.contains({world, mode});
  }
  /// How often, as whole batches or as others.
  [[nodiscard]] PoseInterest::Every EveryOf(WorldId world, protocol::PoseMode mode) const;
  /// Avatars whose poses suffice, growing. Empty: whole batches are wanted, or nothing is.
  [[nodiscard]] std::span<const AvatarId> Named(WorldId world, protocol::PoseMode mode) const;

  /// What the region of that world reaches in that mode; empty: there is none.
  [[nodiscard]] std::optional<RegionFilter> ReachOf(WorldId world, protocol::PoseMode mode) const;

  [[nodiscard]] Share ShareOf(const PoseDelivery& delivery) const;
  /// The rows of a delivery that Share::kSome is about; without value: none has a pose and the client knows
  /// already. They hold until the next call of anything here.
  [[nodiscard]] std::optional<std::span<const std::uint32_t>> Pick(const PoseDelivery& delivery);
  /// The region of that world with a ring of that mode; null: there is none.
  [[nodiscard]] RegionMembers* RegionOf(WorldId world, protocol::PoseMode mode);
  /// The same of Share::kRegion. The delivery has places.
  [[nodiscard]] RegionMembers::Change UpdateRegion(const PoseDelivery& delivery);

 private:
  using Key = std::pair<WorldId, protocol::PoseMode>;
  /// What is sent of one shard.
  struct Lane {
    protocol::PoseRows::Avatars avatars;  // for which `rows` holds
    std::vector<std::uint32_t> rows;
    bool is_empty_told = false;
  };
  /// The subscriptions of one world and mode together.
  struct Watch {
    PoseInterest::Every every;
    std::vector<AvatarId> named;  // growing; empty: all
    std::map<int, Lane> lanes;
  };

  [[nodiscard]] const RegionMembers* FindRegion(const Key& key) const;
  [[nodiscard]] static std::vector<protocol::PoseMode> ModesOf(const Subscription& subscription);
  /// How often it wants those poses; 0: it does not.
  [[nodiscard]] static std::uint16_t EveryOf(const Subscription& subscription, const Key& key);
  void SumUp(const Key& key);
  void SumUpAll(const Subscription& subscription);
  void CountNamed();

  bool is_compact_ = false;
  bool has_detail_ = false;
  std::map<protocol::SubscriptionId, Subscription> all_;
  std::map<Key, Watch> watches_;
  std::size_t named_count_ = 0;
};

}  // namespace stridewire::server
