#include "session/region_members.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace stridewire::server {

void RegionMembers::Move(const protocol::Region& region, double leave_m,
                         std::uint16_t every_n_ticks) {
  region_ = region;
  leave_at_m_ = region.radius_m + region.leave_m.value_or(leave_m);
  every_n_ticks_ = every_n_ticks;
  every_ = every_n_ticks;
  for (const protocol::RateRing& ring : region.rings) every_ = std::gcd(every_, ring.every_n_ticks);
}

std::uint16_t RegionMembers::EveryAt(double distance_m) const {
  for (const protocol::RateRing& ring : region_.rings) {
    if (distance_m <= ring.to_m) return ring.every_n_ticks;
  }
  return every_n_ticks_;
}

RegionMembers::Change RegionMembers::Update(const PoseDelivery& delivery) {
  std::vector<AvatarNumber>& inside = inside_[delivery.from_shard];
  const protocol::PoseRows& rows = *delivery.rows;
  near_.clear();
  const double centre_x = region_.centre_m.x;
  const double centre_z = region_.centre_m.z;
  delivery.places->ForEachNear(centre_x, centre_z, leave_at_m_,
                               [&](std::uint32_t row, double x, double z) {
                                 const double distance_m = std::hypot(x - centre_x, z - centre_z);
                                 if (distance_m <= leave_at_m_) near_.emplace_back(row, distance_m);
                               });
  std::ranges::sort(near_);
  now_.clear();
  entered_.clear();
  left_.clear();
  due_.clear();
  for (const auto& [row, distance_m] : near_) {
    const AvatarNumber number = (*rows.avatars())[row];
    if (!std::ranges::binary_search(inside, number)) {
      // Just after a region has moved the shard may not know yet that its pose is wanted.
      if (distance_m > region_.radius_m || !rows.has_pose(row)) continue;
      entered_.push_back(number);
      due_.push_back(row);
    } else if (rows.has_pose(row) && delivery.tick % EveryAt(distance_m) == 0) {
      due_.push_back(row);
    }
    now_.push_back(number);
  }
  std::ranges::set_difference(inside, now_, std::back_inserter(left_));
  std::swap(inside, now_);
  return {entered_, left_, due_};
}

}  // namespace stridewire::server
