#pragma once

#include <cstdint>
#include <vector>

#include "world/shard_messages.h"

namespace stridewire::server {

/// Combines what the sessions of all shards need from one world.
class WorldInterest {
 public:
  explicit WorldInterest(int shard_count) : interests_(static_cast<std::size_t>(shard_count)) {}

  /// Sets the interest of shard `interest.shard`, which replaces its previous one.
  void Set(const Interest& interest);

  /// Poses that the sessions of one shard need in a given tick.
  struct Demand {
    bool all = false;     ///< True if a batch of all avatars is needed.
    bool subset = false;  ///< True if poses of selected avatars or regions are needed.
  };
  [[nodiscard]] Demand DemandOf(int shard, protocol::PoseMode mode, std::uint64_t tick) const;

  [[nodiscard]] bool WantsEvents(int shard) const { return Of(shard).events; }
  [[nodiscard]] bool WantsMovements(int shard) const { return Of(shard).movements; }

  // The following functions combine all shards:

  [[nodiscard]] bool empty() const;
  [[nodiscard]] bool events() const { return events_; }
  [[nodiscard]] bool movements() const { return movements_; }
  [[nodiscard]] bool movement_regions() const { return movement_regions_; }
  /// Returns true if any session observes poses in this mode.
  [[nodiscard]] bool IsObserved(protocol::PoseMode mode) const;
  [[nodiscard]] bool HasRegions(protocol::PoseMode mode) const;
  /// Returns true if a region has rings of this mode and of other modes.
  [[nodiscard]] bool HasMixedRegions(protocol::PoseMode mode) const;
  /// Returns the observed compact modes, in the order of kSentModes.
  [[nodiscard]] std::vector<protocol::PoseMode> CompactModes() const;
  /// Returns the greatest common divisor of the intervals of all sessions, in ticks; at least 1.
  [[nodiscard]] int CommonInterval() const;
  /// Returns the longest interval of any session in ticks, at least 1.
  [[nodiscard]] std::uint16_t max_interval() const { return max_interval_; }
  /// Returns the ascending ids of all selected avatars.
  [[nodiscard]] std::vector<AvatarId> SelectedAvatars(protocol::PoseMode mode) const;
  /// Calls `function(const RegionFilter&)` for each region.
  template <typename Function>
  void ForEachRegion(protocol::PoseMode mode, Function&& function) const {
    for (const Interest& shard : interests_) {
      const auto& regions = shard.poses[ModeIndex(mode)].regions;
      if (regions == nullptr) continue;
      for (const RegionFilter& region : *regions) function(region);
    }
  }

 private:
  [[nodiscard]] const Interest& Of(int shard) const {
    return interests_[static_cast<std::size_t>(shard)];
  }

  std::vector<Interest> interests_;  // by shard
  bool events_ = false;
  bool movements_ = false;
  bool movement_regions_ = false;
  std::uint16_t max_interval_ = 1;
};

}  // namespace stridewire::server
