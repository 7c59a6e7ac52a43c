#include "session/subscriptions.h"

#include <algorithm>
#include <numeric>

namespace stridewire::server {

using protocol::PoseDetail;
using protocol::PoseMode;
using protocol::SubscriptionId;

namespace {

// The region of a world with a ring of that mode; null: there is none.
template <typename All>
auto RegionIn(All& all, const std::pair<WorldId, PoseMode>& key)
    -> decltype(&*all.begin()->second.region) {
  const auto it = std::ranges::find_if(all, [&](const auto& item) {
    return item.second.region && item.second.world == key.first &&
           item.second.region->every(key.second) > 0;
  });
  return it == all.end() ? nullptr : &*it->second.region;
}

}  // namespace

PoseMode Subscriptions::SentMode(PoseMode asked, PoseDetail detail) const {
  if (asked != PoseMode::kQuantised && !IsCompact(asked)) return asked;
  if (!is_compact_) return PoseMode::kQuantised;
  return CompactMode(has_detail_ ? detail : PoseDetail::kAll);
}

void Subscriptions::SetCompact(bool is_compact, bool has_detail) {
  if (is_compact == is_compact_ && has_detail == has_detail_) return;
  is_compact_ = is_compact;
  has_detail_ = has_detail;
  watches_.clear();
  for (auto& [id, subscription] : all_) {
    const auto sent = [this](PoseMode mode) { return SentMode(mode, DetailOf(mode)); };
    subscription.mode = sent(subscription.mode);
    if (subscription.region) subscription.region->ChangeModes(sent);
    SumUpAll(subscription);
  }
}

std::vector<PoseMode> Subscriptions::ModesOf(const Subscription& subscription) {
  return subscription.region ? subscription.region->modes() : std::vector{subscription.mode};
}

std::uint16_t Subscriptions::EveryOf(const Subscription& subscription, const Key& key) {
  if (subscription.world != key.first) return 0;
  if (subscription.region) return subscription.region->every(key.second);
  return subscription.mode == key.second ? subscription.every_n_ticks : 0;
}

void Subscriptions::SumUpAll(const Subscription& subscription) {
  for (const PoseMode mode : ModesOf(subscription)) SumUp({subscription.world, mode});
}

void Subscriptions::Add(SubscriptionId id, Subscription&& subscription) {
  std::ranges::sort(subscription.avatars);
  const auto twice = std::ranges::unique(subscription.avatars);
  subscription.avatars.erase(twice.begin(), twice.end());
  SumUpAll(all_.emplace(id, std::move(subscription)).first->second);
}

std::optional<Subscriptions::Subscription> Subscriptions::Remove(SubscriptionId id) {
  const auto it = all_.find(id);
  if (it == all_.end()) return std::nullopt;
  Subscription removed = std::move(it->second);
  all_.erase(it);
  SumUpAll(removed);
  return removed;
}

void Subscriptions::RemoveWorld(WorldId world) {
  std::erase_if(all_, [&](const auto& item) { return item.second.world == world; });
  std::erase_if(watches_, [&](const auto& item) { return item.first.first == world; });
  CountNamed();
}

void Subscriptions::TellAnew() {
  for (auto& [key, watch] : watches_) {
    for (auto& [shard, lane] : watch.lanes) lane.is_empty_told = false;
  }
}

void Subscriptions::CountNamed() {
  named_count_ = 0;
  for (const auto& [id, subscription] : all_) named_count_ += subscription.avatars.size();
}

void Subscriptions::SumUp(const Key& key) {
  CountNamed();
  Watch watch;
  bool is_whole = false;
  std::uint16_t every = 0;
  for (const auto& [id, subscription] : all_) {
    const std::uint16_t wanted = EveryOf(subscription, key);
    if (wanted == 0) continue;
    every = std::gcd(every, wanted);
    is_whole |= subscription.avatars.empty() && !subscription.region;
    std::vector<AvatarId> named;
    named.reserve(watch.named.size() + subscription.avatars.size());
    std::ranges::set_union(watch.named, subscription.avatars, std::back_inserter(named));
    watch.named = std::move(named);
  }
  if (is_whole) watch.named.clear();
  (is_whole ? watch.every.whole : watch.every.some) = every;
  if (every == 0) {
    watches_.erase(key);
  } else {
    watches_[key] = std::move(watch);
  }
}

bool Subscriptions::WithEvents(WorldId world) const {
  return std::ranges::any_of(all_, [&](const auto& item) {
    return item.second.world == world && item.second.with_events;
  });
}

PoseInterest::Every Subscriptions::EveryOf(WorldId world, PoseMode mode) const {
  const auto it = watches_.find({world, mode});
  return it == watches_.end() ? PoseInterest::Every{} : it->second.every;
}

std::span<const AvatarId> Subscriptions::Named(WorldId world, PoseMode mode) const {
  const auto it = watches_.find({world, mode});
  return it == watches_.end() ? std::span<const AvatarId>() : it->second.named;
}

bool Subscriptions::WatchesWorld(WorldId world) const {
  return std::ranges::any_of(watches_, [&](const auto& item) { return item.first.first == world; });
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

bool Subscriptions::MoveRegion(SubscriptionId id, const protocol::Observe& moved, double leave_m) {
  const auto it = all_.find(id);
  if (it == all_.end()) return false;
  Subscription& subscription = it->second;
  if (!subscription.region || !moved.region || subscription.world != moved.world ||
      subscription.mode != moved.mode) {
    return false;
  }
  const std::vector<PoseMode> before = subscription.region->modes();
  subscription.region->Move(*moved.region, leave_m, moved.every_n_ticks, moved.mode);
  subscription.every_n_ticks = moved.every_n_ticks;
  subscription.with_events = moved.with_events;
  for (const PoseMode mode : before) SumUp({moved.world, mode});
  SumUpAll(subscription);
  return true;
}

const RegionMembers* Subscriptions::FindRegion(const Key& key) const { return RegionIn(all_, key); }

std::optional<RegionFilter> Subscriptions::ReachOf(WorldId world, PoseMode mode) const {
  const RegionMembers* region = FindRegion({world, mode});
  return region == nullptr ? std::nullopt : std::optional(region->reach(mode));
}

RegionMembers* Subscriptions::RegionOf(WorldId world, PoseMode mode) {
  return RegionIn(all_, {world, mode});
}

RegionMembers::Change Subscriptions::UpdateRegion(const PoseDelivery& delivery) {
  return RegionOf(delivery.world, delivery.mode)->Update(delivery);
}

Subscriptions::Share Subscriptions::ShareOf(const PoseDelivery& delivery) const {
  const auto watch = watches_.find({delivery.world, delivery.mode});
  if (watch == watches_.end()) return Share::kNone;
  if (const RegionMembers* region = FindRegion({delivery.world, delivery.mode})) {
    return delivery.tick % region->every(delivery.mode) == 0 ? Share::kRegion : Share::kNone;
  }
  const bool is_due = std::ranges::any_of(all_, [&](const auto& item) {
    const Subscription& subscription = item.second;
    return subscription.world == delivery.world && subscription.mode == delivery.mode &&
           delivery.tick % subscription.every_n_ticks == 0;
  });
  if (!is_due) return Share::kNone;
  return watch->second.every.whole > 0 ? Share::kWhole : Share::kSome;
}

std::optional<std::span<const std::uint32_t>> Subscriptions::Pick(const PoseDelivery& delivery) {
  Watch& watch = watches_.at({delivery.world, delivery.mode});
  Lane& lane = watch.lanes[delivery.from_shard];
  const protocol::PoseRows& rows = *delivery.rows;
  if (lane.avatars != rows.avatars()) {
    lane.avatars = rows.avatars();
    lane.rows.clear();
    const std::vector<AvatarId>& avatars = *lane.avatars;
    auto from = avatars.begin();
    for (const AvatarId number : watch.named) {
      from = std::lower_bound(from, avatars.end(), number);
      if (from == avatars.end()) break;
      if (*from == number) lane.rows.push_back(static_cast<std::uint32_t>(from - avatars.begin()));
    }
  }
  const bool is_empty =
      std::ranges::none_of(lane.rows, [&](std::uint32_t row) { return rows.has_pose(row); });
  if (is_empty && lane.is_empty_told) return std::nullopt;
  lane.is_empty_told = is_empty;
  return lane.rows;
}

}  // namespace stridewire::server
