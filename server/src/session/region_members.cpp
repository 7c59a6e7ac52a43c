#include "session/region_members.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

namespace stridewire::server {

using protocol::PoseMode;

void RegionMembers::Move(const protocol::Region& region, double leave_m,
                         std::uint16_t every_n_ticks, PoseMode mode) {
  centre_m_ = region.centre_m;
  radius_m_ = region.radius_m;
  leave_at_m_ = region.radius_m + region.leave_m.value_or(leave_m);
  ring_count_ = 0;
  for (std::size_t i = 0; i < region.rings.size(); ++i) {
    const protocol::RateRing& ring = region.rings[i];
    rings_[ring_count_++] = {
        ring.to_m, ring.every_n_ticks,
        region.ring_details.empty() ? mode : CompactMode(region.ring_details[i])};
  }
  rings_[ring_count_++] = {std::numeric_limits<double>::infinity(), every_n_ticks, mode};
  SumUp();
}

void RegionMembers::SumUp() {
  every_ = {};
  for (const Ring& ring : rings()) {
    std::uint16_t& every = every_[static_cast<std::size_t>(ring.mode)];
    every = std::gcd(every, ring.every_n_ticks);
  }
}

const RegionMembers::Ring& RegionMembers::RingAt(double distance_m2) const {
  auto ring = rings_.begin();
  while (distance_m2 > ring->to_m * ring->to_m) ++ring;  // nothing is beyond the last
  return *ring;
}

std::vector<PoseMode> RegionMembers::modes() const {
  std::vector<PoseMode> modes;
  for (std::size_t mode = 0; mode < every_.size(); ++mode) {
    if (every_[mode] > 0) modes.push_back(static_cast<PoseMode>(mode));
  }
  return modes;
}

RegionFilter RegionMembers::reach(PoseMode mode) const {
  const auto is_of_mode = [&](const Ring& ring) { return ring.mode == mode; };
  const std::span<const Ring> all = rings();
  const auto first = std::ranges::find_if(all, is_of_mode);
  const auto last = std::find_if(all.rbegin(), all.rend(), is_of_mode);
  return {.x = centre_m_.x,
          .z = centre_m_.z,
          .reach_m = std::min(last->to_m, leave_at_m_),
          .beyond_m = first == all.begin() ? 0.0 : (first - 1)->to_m,
          .is_one_of_several = !std::ranges::all_of(all, is_of_mode)};
}

RegionMembers::Change RegionMembers::Update(const PoseDelivery& delivery) {
  return Update(delivery.from_shard, delivery.tick, delivery.rows->avatars(), *delivery.places,
                delivery.rows.get(), delivery.mode);
}

RegionMembers::Change RegionMembers::Update(int from_shard, std::uint64_t tick,
                                            const protocol::PoseRows::Avatars& avatars,
                                            const SpatialGrid& places, const protocol::PoseRows* rows,
                                            PoseMode mode) {
  const auto has_pose = [&](std::uint32_t row) { return rows == nullptr || rows->has_pose(row); };
  Lane& lane = lanes_[from_shard];
  if (lane.avatars != avatars) {
    lane.avatars = avatars;
    lane.is_inside.assign(lane.avatars->size(), false);
    for (const AvatarId number : lane.inside) {
      const auto at = std::ranges::lower_bound(*lane.avatars, number);
      if (at == lane.avatars->end() || *at != number) continue;
      lane.is_inside[static_cast<std::size_t>(at - lane.avatars->begin())] = true;
    }
  }
  near_.clear();
  const double centre_x = centre_m_.x;
  const double centre_z = centre_m_.z;
  const double enter_m2 = radius_m_ * radius_m_;
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
  const bool is_uniform = ring_count_ == 1;  // most are: nothing is to be looked up
  for (const auto& [row, distance_m2] : near_) {
    const AvatarId number = (*lane.avatars)[row];
    const Ring& ring = is_uniform ? rings_[0] : RingAt(distance_m2);
    const bool is_of_mode = is_uniform || ring.mode == mode;
    if (!lane.is_inside[row]) {
      // Just after a region has moved the shard may not know yet that its pose is wanted.
      if (!is_of_mode || !has_pose(row)) continue;
      entered_.push_back(number);
      due_.push_back(row);
    } else if (is_of_mode && has_pose(row) && tick % ring.every_n_ticks == 0) {
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
