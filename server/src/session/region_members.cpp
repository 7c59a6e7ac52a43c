#include "session/region_members.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "base/check.h"

namespace stridewire::server {

using protocol::PoseMode;

void RegionMembers::Set(const protocol::Region& region, double default_leave_m,
                        std::uint16_t every_n_ticks, PoseMode mode) {
  STRIDEWIRE_CHECK(region.rings.size() < rings_.size() && every_n_ticks >= 1);
  centre_m_ = region.centre_m;
  radius_m_ = region.radius_m;
  leave_radius_m_ = region.radius_m + region.leave_m.value_or(default_leave_m);
  ring_count_ = 0;
  for (std::size_t i = 0; i < region.rings.size(); ++i) {
    const protocol::RateRing& ring = region.rings[i];
    rings_[ring_count_++] = {
        ring.to_m, ring.every_n_ticks,
        region.ring_details.empty() ? mode : CompactMode(region.ring_details[i])};
  }
  rings_[ring_count_++] = {std::numeric_limits<double>::infinity(), every_n_ticks, mode};
  CombineIntervals();
}

void RegionMembers::CombineIntervals() {
  intervals_ = {};
  for (const Ring& ring : rings()) {
    std::uint16_t& interval = intervals_[static_cast<std::size_t>(ring.mode)];
    interval = std::gcd(interval, ring.every_n_ticks);
  }
}

const RegionMembers::Ring& RegionMembers::RingAt(double distance_m2) const {
  auto ring = rings_.begin();
  // The last ring is unbounded, so the loop ends.
  while (distance_m2 > ring->outer_m * ring->outer_m) ++ring;
  return *ring;
}

std::vector<PoseMode> RegionMembers::modes() const {
  std::vector<PoseMode> modes;
  for (std::size_t mode = 0; mode < intervals_.size(); ++mode) {
    if (intervals_[mode] > 0) modes.push_back(static_cast<PoseMode>(mode));
  }
  return modes;
}

RegionFilter RegionMembers::filter(PoseMode mode) const {
  STRIDEWIRE_CHECK(interval(mode) > 0);
  const auto is_of_mode = [&](const Ring& ring) { return ring.mode == mode; };
  const std::span<const Ring> all = rings();
  const auto first = std::ranges::find_if(all, is_of_mode);
  const auto last = std::find_if(all.rbegin(), all.rend(), is_of_mode);
  return {.x = centre_m_.x,
          .z = centre_m_.z,
          .outer_m = std::min(last->outer_m, leave_radius_m_),
          .inner_m = first == all.begin() ? 0.0 : (first - 1)->outer_m,
          .is_one_of_several = !std::ranges::all_of(all, is_of_mode)};
}

RegionMembers::Change RegionMembers::Update(const PoseDelivery& delivery) {
  STRIDEWIRE_CHECK(delivery.grid != nullptr && interval(delivery.mode) > 0);
  return Update({.from_shard = delivery.from_shard,
                 .tick = delivery.tick,
                 .avatars = delivery.rows->avatars(),
                 .grid = *delivery.grid,
                 .rows = delivery.rows.get(),
                 .mode = delivery.mode});
}

RegionMembers::Change RegionMembers::Update(const MovementDelivery& delivery) {
  STRIDEWIRE_CHECK(delivery.grid != nullptr && delivery.avatars != nullptr);
  return Update({.from_shard = delivery.from_shard,
                 .tick = delivery.tick,
                 .avatars = delivery.avatars,
                 .grid = *delivery.grid,
                 .rows = nullptr,
                 .mode = PoseMode::kMovement});
}

RegionMembers::ShardMembers& RegionMembers::MembersOf(const Snapshot& snapshot) {
  ShardMembers& shard = shards_[snapshot.from_shard];
  if (shard.avatars == snapshot.avatars) return shard;
  shard.avatars = snapshot.avatars;
  shard.is_member.assign(shard.avatars->size(), false);
  for (const AvatarId id : shard.members) {
    const auto at = std::ranges::lower_bound(*shard.avatars, id);
    if (at == shard.avatars->end() || *at != id) continue;
    shard.is_member[static_cast<std::size_t>(at - shard.avatars->begin())] = true;
  }
  return shard;
}

RegionMembers::Change RegionMembers::Update(const Snapshot& snapshot) {
  const protocol::PoseRows* rows = snapshot.rows;
  const PoseMode mode = snapshot.mode;
  const std::uint64_t tick = snapshot.tick;
  const auto has_pose = [&](std::uint32_t row) { return rows == nullptr || rows->has_pose(row); };
  ShardMembers& shard = MembersOf(snapshot);
  near_.clear();
  const double centre_x = centre_m_.x;
  const double centre_z = centre_m_.z;
  const double enter_m2 = radius_m_ * radius_m_;
  const double leave_m2 = leave_radius_m_ * leave_radius_m_;
  snapshot.grid.ForEachNear(centre_x, centre_z, leave_radius_m_,
                            [&](std::uint32_t row, double x, double z) {
                              const double distance_m2 =
                                  (x - centre_x) * (x - centre_x) + (z - centre_z) * (z - centre_z);
                              if (distance_m2 > (shard.is_member[row] ? leave_m2 : enter_m2))
                                return;
                              near_.emplace_back(row, distance_m2);
                            });
  std::ranges::sort(near_);
  now_.clear();
  entered_.clear();
  left_.clear();
  due_.clear();
  std::size_t kept = 0;
  const bool is_uniform = ring_count_ == 1;  // Most regions have one ring.
  for (const auto& [row, distance_m2] : near_) {
    const AvatarId id = (*shard.avatars)[row];
    const Ring& ring = is_uniform ? rings_[0] : RingAt(distance_m2);
    const bool is_of_mode = is_uniform || ring.mode == mode;
    if (!shard.is_member[row]) {
      // Directly after a region has moved, the shard may not have encoded this pose yet.
      if (!is_of_mode || !has_pose(row)) continue;
      entered_.push_back(id);
      due_.push_back(row);
    } else if (is_of_mode && has_pose(row) && tick % ring.every_n_ticks == 0) {
      due_.push_back(row);
    }
    now_.push_back(id);
    near_[kept++].first = row;
  }
  if (!entered_.empty() || now_.size() < shard.members.size()) {
    std::ranges::set_difference(shard.members, now_, std::back_inserter(left_));
    STRIDEWIRE_CHECK(shard.members.size() + entered_.size() == now_.size() + left_.size());
    std::swap(shard.members, now_);
    shard.is_member.assign(shard.avatars->size(), false);
    for (std::size_t i = 0; i < kept; ++i) shard.is_member[near_[i].first] = true;
  }
  return {entered_, left_, due_};
}

}  // namespace stridewire::server
