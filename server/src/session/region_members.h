#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "world/shard_messages.h"

namespace stridewire::server {

/// Who is in a region that a session observes: who came within its radius and has not gone further than radius and
/// leave_m since. Worked out shard by shard, each time with poses of a tick.
///
/// Rings may be of different modes (details): then deliveries of each come one after the other, and each has due those
/// who are in a ring of its mode.
///
///        centre  compact       8 m   fewer          20 m   root    radius  + leave_m
///   rows   |------- 3 -- 9 -----|---- 1 -------- 4 --|----- 7 -------|--------|
///   due    [3, 9]                [1, 4]               [7]
///
/// Who enters does so with the delivery that has its pose; who leaves, with the first that comes. So nobody is told twice,
/// and who only crosses a ring neither leaves nor enters.
class RegionMembers {
 public:
  /// `leave_m` where the region says nothing; beyond its rings poses come every `every_n_ticks` in `mode`.
  void Move(const protocol::Region& region, double leave_m, std::uint16_t every_n_ticks,
            protocol::PoseMode mode);
  /// Puts `function(mode)` in the place of each mode.
  template <typename Function>
  void ChangeModes(Function&& function) {
    for (Ring& ring : std::span(rings_).first(ring_count_)) ring.mode = function(ring.mode);
    SumUp();
  }

  /// Those of its rings and beyond, each once.
  [[nodiscard]] std::vector<protocol::PoseMode> modes() const;
  /// Of the ticks wanted in a mode those that this divides; 0: no ring is of that mode.
  [[nodiscard]] std::uint16_t every(protocol::PoseMode mode) const {
    return every_[static_cast<std::size_t>(mode)];
  }
  /// What holds all rings of that mode, of which there is one.
  [[nodiscard]] RegionFilter reach(protocol::PoseMode mode) const;

  /// What came of a delivery, which has places and is of one of the modes. Holds until the next call.
  struct Change {
    std::span<const AvatarId> entered;  ///< Growing.
    std::span<const AvatarId> left;     ///< The same. Also who is not in the world any more.
    std::span<const std::uint32_t> due;     ///< Rows whose poses are to be sent.
  };
  [[nodiscard]] Change Update(const PoseDelivery& delivery);
  /// The same of all avatars of a shard, whose poses nobody asks for.
  [[nodiscard]] Change Update(int from_shard, std::uint64_t tick,
                              const protocol::PoseRows::Avatars& avatars, const SpatialGrid& places) {
    return Update(from_shard, tick, avatars, places, nullptr, protocol::PoseMode::kMovement);
  }
  /// Who of a shard is in it, growing.
  [[nodiscard]] const std::vector<AvatarId>& inside(int shard) { return lanes_[shard].inside; }

 private:
  // `rows` null: all have poses.
  [[nodiscard]] Change Update(int from_shard, std::uint64_t tick,
                              const protocol::PoseRows::Avatars& avatars, const SpatialGrid& places,
                              const protocol::PoseRows* rows, protocol::PoseMode mode);
  struct Ring {
    double to_m = 0.0;
    std::uint16_t every_n_ticks = 1;
    protocol::PoseMode mode = protocol::PoseMode::kFull;
  };
  [[nodiscard]] const Ring& RingAt(double distance_m2) const;
  void SumUp();

  protocol::GroundPoint centre_m_;
  double radius_m_ = 0.0;
  double leave_at_m_ = 0.0;
  [[nodiscard]] std::span<const Ring> rings() const { return std::span(rings_).first(ring_count_); }
  std::array<Ring, protocol::kMaxRateRings + 1>
      rings_;  // growing; the last is what is beyond the others
  std::size_t ring_count_ = 0;
  std::array<std::uint16_t, kSentModes.size() + 1> every_{};  // by mode, movement among them
  struct Lane {
    std::vector<AvatarId> inside;  // growing
    protocol::PoseRows::Avatars avatars;
    std::vector<bool> is_inside;  // by row of those
  };
  std::map<int, Lane> lanes_;  // by shard
  // What the last Change is about.
  std::vector<std::pair<std::uint32_t, double>> near_;  // row, distance squared
  std::vector<AvatarId> now_;
  std::vector<AvatarId> entered_;
  std::vector<AvatarId> left_;
  std::vector<std::uint32_t> due_;
};

}  // namespace stridewire::server
