#include "session/region_members.h"

#include <algorithm>
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

std::uint16_t RegionMembers::EveryAt(double distance_m2) const {
  for (const protocol::RateRing& ring : region_.rings) {
    if (distance_m2 <= ring.to_m * ring.to_m) return ring.every_n_ticks;
  }
  return every_n_ticks_;
}

RegionMembers::Change RegionMembers::Update(const PoseDelivery& delivery) {
  return Update(delivery.from_shard, delivery.tick, delivery.rows->avatars(), *delivery.places,
                delivery.rows.get());
}

RegionMembers::Change RegionMembers::Update(int from_shard, std::uint64_t tick,
                                            const protocol::PoseRows::Avatars& avatars,
                                            const Places& places, const protocol::PoseRows* rows) {
  const auto has_pose = [&](std::uint32_t row) { return rows == nullptr || rows->has_pose(row); };
  Lane& lane = lanes_[from_shard];
  if (lane.avatars != avatars) {
    lane.avatars = avatars;
    lane.is_inside.assign(lane.avatars->size(), false);
    for (const AvatarNumber number : lane.inside) {
      const auto at = std::ranges::lower_bound(*lane.avatars, number);
      if (at == lane.avatars->end() || *at != number) continue;
      lane.is_inside[static_cast<std::size_t>(at - lane.avatars->begin())] = true;
    }
  }
  near_.clear();
  const double centre_x = region_.centre_m.x;
  const double centre_z = region_.centre_m.z;
  const double enter_m2 = region_.radius_m * region_.radius_m;
  const double leave_m2 = leave_at_m_ * leave_at_m_;
  places.ForEachNear(centre_x, centre_z, leave_at_m_, [&](std::uint32_t row, double x, double z) {
    const double distance_m2 = (x - centre_x) * (x - centre_x) + (z - centre_z) * (z - centre_z);
    if (distance_m2 > (lane.is_inside[row] ? leave_m2 : enter_m2)) return;
    near_.emplace_back(row, distance_m2);
  });
  std::ranges::sort(near_);
  now_.clear();
  entered_.clear();
  left_.clear();
  due_.clear();
  std::size_t kept = 0;
  for (const auto& [row, distance_m2] : near_) {
    const AvatarNumber number = (*lane.avatars)[row];
    if (!lane.is_inside[row]) {
      // Just after a region has moved the shard may not know yet that its pose is wanted.
      if (!has_pose(row)) continue;
      entered_.push_back(number);
      due_.push_back(row);
    } else if (has_pose(row) && tick % EveryAt(distance_m2) == 0) {
      due_.push_back(row);
    }
    now_.push_back(number);
    near_[kept++].first = row;
  }
  if (!entered_.empty() || now_.size() < lane.inside.size()) {
    std::ranges::set_difference(lane.inside, now_, std::back_inserter(left_));
    std::swap(lane.inside, now_);
    lane.is_inside.assign(lane.avatars->size(), false);
    for (std::size_t i = 0; i < kept; ++i) lane.is_inside[near_[i].first] = true;
  }
  return {entered_, left_, due_};
}

}  // namespace stridewire::server
