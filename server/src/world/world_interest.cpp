#include "world/world_interest.h"

#include <algorithm>
#include <iterator>
#include <numeric>

#include "base/check.h"
#include "world/id_set.h"

namespace stridewire::server {

using protocol::PoseMode;

void WorldInterest::Set(const Interest& interest) {
  const auto shard = static_cast<std::size_t>(interest.shard);
  STRIDEWIRE_CHECK(shard < interests_.size());
  STRIDEWIRE_CHECK(!interest.movement_regions || interest.movements);
  interests_[shard] = interest;
  events_ = false;
  movements_ = false;
  movement_regions_ = false;
  max_interval_ = 1;
  for (const Interest& of_shard : interests_) {
    events_ |= of_shard.events;
    movements_ |= of_shard.movements;
    movement_regions_ |= of_shard.movement_regions;
    for (const PoseInterest& poses : of_shard.poses) {
      max_interval_ = std::max({max_interval_, poses.interval.all, poses.interval.subset});
    }
  }
}

WorldInterest::Demand WorldInterest::DemandOf(int shard, PoseMode mode, std::uint64_t tick) const {
  const SendInterval& interval = Of(shard).poses[ModeIndex(mode)].interval;
  return {.all = interval.all > 0 && tick % interval.all == 0,
          .subset = interval.subset > 0 && tick % interval.subset == 0};
}

bool WorldInterest::empty() const {
  return !events_ && !movements_ &&
         std::ranges::none_of(kSentModes, [&](PoseMode mode) { return IsObserved(mode); });
}

bool WorldInterest::IsObserved(PoseMode mode) const {
  return std::ranges::any_of(interests_, [&](const Interest& shard) {
    return shard.poses[ModeIndex(mode)].interval != SendInterval{};
  });
}

bool WorldInterest::HasRegions(PoseMode mode) const {
  bool has_regions = false;
  ForEachRegion(mode, [&](const RegionFilter&) { has_regions = true; });
  return has_regions;
}

bool WorldInterest::HasMixedRegions(PoseMode mode) const {
  bool is_mixed = false;
  ForEachRegion(mode, [&](const RegionFilter& region) { is_mixed |= region.is_one_of_several; });
  return is_mixed;
}

std::vector<PoseMode> WorldInterest::CompactModes() const {
  std::vector<PoseMode> modes;
  std::ranges::copy_if(kSentModes, std::back_inserter(modes), [&](PoseMode mode) {
    return protocol::IsCompact(mode) && IsObserved(mode);
  });
  return modes;
}

int WorldInterest::CommonInterval() const {
  int common = movement_regions_ ? 1 : 0;
  for (const Interest& shard : interests_) {
    for (const PoseInterest& poses : shard.poses) {
      common = std::gcd(common, std::gcd<int>(poses.interval.all, poses.interval.subset));
    }
  }
  return std::max(common, 1);
}

std::vector<AvatarId> WorldInterest::SelectedAvatars(PoseMode mode) const {
  IdSet ids;
  for (const Interest& shard : interests_) {
    const auto& avatars = shard.poses[ModeIndex(mode)].avatars;
    if (avatars != nullptr) ids.Add(*avatars);
  }
  return ids.Take();
}

}  // namespace stridewire::server
