#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "world/shard_messages.h"

namespace stridewire::server {

/// Tracks which avatars are in the region that a session observes. An avatar enters when it comes
/// within the radius, and leaves when it is farther than radius + leave_m. Each update concerns the
/// avatars of one shard.
///
/// A region has rings with different intervals and possibly different modes. Each mode has its own
/// deliveries. From a delivery, the client receives the avatars in the rings of its mode ("due"):
///
///        centre  compact       8 m   reduced         20 m   root    radius  + leave_m
///   rows   |------- 3 -- 9 -----|---- 1 -------- 4 --|----- 7 -------|--------|
///   due    [3, 9]                [1, 4]               [7]
///
/// An avatar is reported as entered with the first delivery that contains its pose, and as left
/// with the next delivery of any mode. Each change is thus reported once. A move from one ring to
/// another is not reported.
class RegionMembers {
 public:
  /// Sets the region. Beyond its rings, poses are due every `every_n_ticks` ticks in `mode`.
  /// `default_leave_m` applies if `region` has no leave_m. Members stay members while they are in
  /// the new region.
  void Set(const protocol::Region& region, double default_leave_m, std::uint16_t every_n_ticks,
           protocol::PoseMode mode);

  /// Returns the modes of all rings, each once.
  [[nodiscard]] std::vector<protocol::PoseMode> modes() const;
  /// Returns the greatest common divisor of the intervals of all rings of this mode, in ticks. 0:
  /// no ring has this mode.
  [[nodiscard]] std::uint16_t interval(protocol::PoseMode mode) const {
    return intervals_[static_cast<std::size_t>(mode)];
  }
  /// Returns the disc or ring that contains all rings of this mode. At least one must exist.
  [[nodiscard]] RegionFilter filter(protocol::PoseMode mode) const;

  /// The result of an update, valid until the next call. All ids and rows are ascending.
  struct Change {
    std::span<const AvatarId> entered;
    /// Avatars that have left, including those that were removed from the world.
    std::span<const AvatarId> left;
    std::span<const std::uint32_t> due;  ///< Rows whose poses must be sent.
  };
  /// Updates the members from poses. `delivery` must contain positions, and its mode must be one of
  /// modes().
  [[nodiscard]] Change Update(const PoseDelivery& delivery);
  /// Updates the members without poses, for movement mode.
  [[nodiscard]] Change Update(const MovementDelivery& delivery);
  /// Returns the ids of the members on a shard, in ascending order.
  [[nodiscard]] const std::vector<AvatarId>& members(int shard) { return shards_[shard].members; }

 private:
  struct Ring {
    double outer_m = 0.0;
    std::uint16_t every_n_ticks = 1;
    protocol::PoseMode mode = protocol::PoseMode::kFull;
  };
  struct ShardMembers {
    std::vector<AvatarId> members;
    protocol::PoseRows::Avatars avatars;  // All avatars of the shard.
    std::vector<bool> is_member;          // [row of `avatars`]: true for members.
  };
  /// The parts of a PoseDelivery or MovementDelivery that Update uses.
  struct Snapshot {
    int from_shard;
    std::uint64_t tick;
    const protocol::PoseRows::Avatars& avatars;
    const SpatialGrid& grid;
    const protocol::PoseRows* rows;  // Rows of poses. Null: treat all avatars as if they had poses.
    protocol::PoseMode mode;
  };
  [[nodiscard]] Change Update(const Snapshot& snapshot);
  [[nodiscard]] ShardMembers& MembersOf(const Snapshot& snapshot);
  [[nodiscard]] const Ring& RingAt(double distance_m2) const;
  [[nodiscard]] std::span<const Ring> rings() const { return std::span(rings_).first(ring_count_); }
  void CombineIntervals();

  protocol::GroundPoint centre_m_;
  double radius_m_ = 0.0;
  double leave_radius_m_ = 0.0;
  // Rings from the inside out; the last one is unbounded.
  std::array<Ring, protocol::kMaxRateRings + 1> rings_;
  std::size_t ring_count_ = 0;
  // [mode]: greatest common divisor of the intervals of the rings that use the mode, in ticks; 0 if
  // none does. In addition to kSentModes, there is an entry for kMovement.
  std::array<std::uint16_t, kSentModes.size() + 1> intervals_{};
  std::map<int, ShardMembers> shards_;
  // Scratch memory, and the arrays to which the last Change refers.
  std::vector<std::pair<std::uint32_t, double>> near_;  // Rows and squared distances.
  std::vector<AvatarId> now_;
  std::vector<AvatarId> entered_;
  std::vector<AvatarId> left_;
  std::vector<std::uint32_t> due_;
};

}  // namespace stridewire::server
