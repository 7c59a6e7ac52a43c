#include "session/subscriptions.h"

#include <algorithm>
#include <iterator>
#include <numeric>

#include "base/check.h"

namespace stridewire::server {

using protocol::PoseDetail;
using protocol::PoseMode;
using protocol::SubscriptionId;

namespace {

template <typename Map>
auto FindRegionIn(Map& subscriptions, WorldId world, PoseMode mode)
    -> decltype(&*subscriptions.begin()->second.region) {
  const auto it = std::ranges::find_if(subscriptions, [&](const auto& item) {
    return item.second.region && item.second.world == world &&
           item.second.region->interval(mode) > 0;
  });
  return it == subscriptions.end() ? nullptr : &*it->second.region;
}

}  // namespace

PoseMode Subscriptions::SentMode(PoseMode mode, PoseDetail detail) {
  return mode == PoseMode::kQuantised ? CompactMode(detail) : mode;
}

std::vector<PoseMode> Subscriptions::ModesOf(const Subscription& subscription) {
  return subscription.region ? subscription.region->modes() : std::vector{subscription.mode};
}

std::uint16_t Subscriptions::IntervalOf(const Subscription& subscription, const Key& key) {
  if (subscription.world != key.first) return 0;
  if (subscription.region) return subscription.region->interval(key.second);
  return subscription.mode == key.second ? subscription.every_n_ticks : 0;
}

void Subscriptions::UpdateChannels(const Subscription& subscription) {
  for (const PoseMode mode : ModesOf(subscription)) UpdateChannel({subscription.world, mode});
}

void Subscriptions::Add(SubscriptionId id, Subscription&& subscription) {
  STRIDEWIRE_CHECK(subscription.every_n_ticks >= 1);
  STRIDEWIRE_CHECK(!subscription.region || subscription.avatars.empty());
  std::ranges::sort(subscription.avatars);
  const auto duplicates = std::ranges::unique(subscription.avatars);
  subscription.avatars.erase(duplicates.begin(), duplicates.end());
  const auto [it, is_new] = all_.emplace(id, std::move(subscription));
  STRIDEWIRE_CHECK(is_new);
  UpdateChannels(it->second);
}

std::optional<Subscriptions::Subscription> Subscriptions::Remove(SubscriptionId id) {
  const auto it = all_.find(id);
  if (it == all_.end()) return std::nullopt;
  Subscription removed = std::move(it->second);
  all_.erase(it);
  UpdateChannels(removed);
  STRIDEWIRE_CHECK(!all_.empty() || channels_.empty());
  return removed;
}

void Subscriptions::RemoveWorld(WorldId world) {
  std::erase_if(all_, [&](const auto& item) { return item.second.world == world; });
  std::erase_if(channels_, [&](const auto& item) { return item.first.first == world; });
  UpdateSelectedCount();
  STRIDEWIRE_CHECK(!all_.empty() || channels_.empty());
}

void Subscriptions::RepeatEmptyBatches() {
  for (auto& [key, channel] : channels_) {
    for (auto& [shard, rows] : channel.shards) rows.was_empty = false;
  }
}

void Subscriptions::UpdateSelectedCount() {
  selected_count_ = 0;
  for (const auto& [id, subscription] : all_) selected_count_ += subscription.avatars.size();
}

void Subscriptions::UpdateChannel(const Key& key) {
  UpdateSelectedCount();
  Channel channel;
  bool has_all = false;
  std::uint16_t interval = 0;
  for (const auto& [id, subscription] : all_) {
    const std::uint16_t own_interval = IntervalOf(subscription, key);
    if (own_interval == 0) continue;
    interval = std::gcd(interval, own_interval);
    has_all |= subscription.avatars.empty() && !subscription.region;
    std::vector<AvatarId> selected;
    selected.reserve(channel.selected.size() + subscription.avatars.size());
    std::ranges::set_union(channel.selected, subscription.avatars, std::back_inserter(selected));
    channel.selected = std::move(selected);
  }
  if (has_all) channel.selected.clear();
  (has_all ? channel.interval.all : channel.interval.subset) = interval;
  if (interval == 0) {
    channels_.erase(key);
  } else {
    channels_[key] = std::move(channel);
  }
}

bool Subscriptions::WantsEvents(WorldId world) const {
  return std::ranges::any_of(all_, [&](const auto& item) {
    return item.second.world == world && item.second.with_events;
  });
}

SendInterval Subscriptions::IntervalOf(WorldId world, PoseMode mode) const {
  const auto it = channels_.find({world, mode});
  return it == channels_.end() ? SendInterval{} : it->second.interval;
}

std::span<const AvatarId> Subscriptions::SelectedAvatars(WorldId world, PoseMode mode) const {
  const auto it = channels_.find({world, mode});
  return it == channels_.end() ? std::span<const AvatarId>() : it->second.selected;
}

bool Subscriptions::ObservesWorld(WorldId world) const {
  return std::ranges::any_of(channels_,
                             [&](const auto& item) { return item.first.first == world; });
}

bool Subscriptions::HasRegion(WorldId world) const {
  return std::ranges::any_of(all_, [&](const auto& item) {
    return item.second.world == world && item.second.region.has_value();
  });
}

std::size_t Subscriptions::region_count() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(all_, [](const auto& item) { return item.second.region.has_value(); }));
}

bool Subscriptions::MoveRegion(SubscriptionId id, const protocol::Observe& moved,
                               double default_leave_m) {
  const auto it = all_.find(id);
  if (it == all_.end()) return false;
  Subscription& subscription = it->second;
  if (!subscription.region || !moved.region || subscription.world != moved.world ||
      subscription.mode != moved.mode) {
    return false;
  }
  const std::vector<PoseMode> before = subscription.region->modes();
  subscription.region->Set(*moved.region, default_leave_m, moved.every_n_ticks, moved.mode);
  subscription.every_n_ticks = moved.every_n_ticks;
  subscription.with_events = moved.with_events;
  for (const PoseMode mode : before) UpdateChannel({moved.world, mode});
  UpdateChannels(subscription);
  return true;
}

std::optional<RegionFilter> Subscriptions::FilterOf(WorldId world, PoseMode mode) const {
  const RegionMembers* region = FindRegionIn(all_, world, mode);
  return region == nullptr ? std::nullopt : std::optional(region->filter(mode));
}

RegionMembers* Subscriptions::FindRegion(WorldId world, PoseMode mode) {
  return FindRegionIn(all_, world, mode);
}

RegionMembers::Change Subscriptions::UpdateRegion(const PoseDelivery& delivery) {
  RegionMembers* region = FindRegion(delivery.world, delivery.mode);
  STRIDEWIRE_CHECK(region != nullptr);
  return region->Update(delivery);
}

Subscriptions::Share Subscriptions::ShareOf(const PoseDelivery& delivery) const {
  const auto channel = channels_.find({delivery.world, delivery.mode});
  if (channel == channels_.end()) return Share::kNone;
  if (const RegionMembers* region = FindRegionIn(all_, delivery.world, delivery.mode)) {
    return delivery.tick % region->interval(delivery.mode) == 0 ? Share::kRegion : Share::kNone;
  }
  const bool is_due = std::ranges::any_of(all_, [&](const auto& item) {
    const Subscription& subscription = item.second;
    return subscription.world == delivery.world && subscription.mode == delivery.mode &&
           delivery.tick % subscription.every_n_ticks == 0;
  });
  if (!is_due) return Share::kNone;
  return channel->second.interval.all > 0 ? Share::kAll : Share::kSubset;
}

std::optional<std::span<const std::uint32_t>> Subscriptions::PickRows(
    const PoseDelivery& delivery) {
  Channel& channel = channels_.at({delivery.world, delivery.mode});
  ShardRows& shard = channel.shards[delivery.from_shard];
  const protocol::PoseRows& rows = *delivery.rows;
  if (shard.avatars != rows.avatars()) {
    shard.avatars = rows.avatars();
    shard.rows.clear();
    const std::vector<AvatarId>& avatars = *shard.avatars;
    auto from = avatars.begin();
    for (const AvatarId id : channel.selected) {
      from = std::lower_bound(from, avatars.end(), id);
      if (from == avatars.end()) break;
      if (*from == id) shard.rows.push_back(static_cast<std::uint32_t>(from - avatars.begin()));
    }
    STRIDEWIRE_CHECK(shard.rows.size() <= channel.selected.size());
  }
  const bool is_empty =
      std::ranges::none_of(shard.rows, [&](std::uint32_t row) { return rows.has_pose(row); });
  if (is_empty && shard.was_empty) return std::nullopt;
  shard.was_empty = is_empty;
  return shard.rows;
}

}  // namespace stridewire::server
