#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "world/mail.h"

namespace stridewire::server {

/// Who is in a region that a session observes: who came within its radius and has not gone further than radius and
/// leave_m since. Worked out shard by shard, each time with poses of a tick.
class RegionMembers {
 public:
  /// `leave_m` where the region says nothing; beyond its rings poses come every `every_n_ticks`.
  void Move(const protocol::Region& region, double leave_m, std::uint16_t every_n_ticks);

  /// Of the ticks wanted those that this divides.
  [[nodiscard]] std::uint16_t every() const { return every_; }
  [[nodiscard]] RegionReach reach() const {
    return {region_.centre_m.x, region_.centre_m.z, leave_at_m_};
  }

  /// What came of a delivery, which has places. Holds until the next call.
  struct Change {
    std::span<const AvatarNumber> entered;  ///< Growing.
    std::span<const AvatarNumber> left;     ///< The same. Also who is not in the world any more.
    std::span<const std::uint32_t> due;     ///< Rows whose poses are to be sent.
  };
  [[nodiscard]] Change Update(const PoseDelivery& delivery);
  /// The same of all avatars of a shard, whose poses nobody asks for.
  [[nodiscard]] Change Update(int from_shard, std::uint64_t tick,
                              const protocol::PoseRows::Avatars& avatars, const Places& places) {
    return Update(from_shard, tick, avatars, places, nullptr);
  }
  /// Who of a shard is in it, growing.
  [[nodiscard]] const std::vector<AvatarNumber>& inside(int shard) { return lanes_[shard].inside; }

 private:
  // `rows` null: all have poses.
  [[nodiscard]] Change Update(int from_shard, std::uint64_t tick,
                              const protocol::PoseRows::Avatars& avatars, const Places& places,
                              const protocol::PoseRows* rows);
  [[nodiscard]] std::uint16_t EveryAt(double distance_m2) const;

  protocol::Region region_;
  double leave_at_m_ = 0.0;
  std::uint16_t every_n_ticks_ = 1;
  std::uint16_t every_ = 1;
  struct Lane {
    std::vector<AvatarNumber> inside;  // growing
    protocol::PoseRows::Avatars avatars;
    std::vector<bool> is_inside;  // by row of those
  };
  std::map<int, Lane> lanes_;  // by shard
  // What the last Change is about.
  std::vector<std::pair<std::uint32_t, double>> near_;  // row, distance squared
  std::vector<AvatarNumber> now_;
  std::vector<AvatarNumber> entered_;
  std::vector<AvatarNumber> left_;
  std::vector<std::uint32_t> due_;
};

}  // namespace stridewire::server
