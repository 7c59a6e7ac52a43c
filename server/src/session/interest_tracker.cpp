#include "session/interest_tracker.h"

#include <numeric>
#include <utility>

#include "base/check.h"
#include "world/id_set.h"

namespace stridewire::server {

using protocol::PoseMode;

InterestTracker::InterestTracker(int shard, const Sessions& sessions, Broadcast broadcast)
    : shard_(shard), sessions_(sessions), broadcast_(std::move(broadcast)) {}

std::span<Session* const> InterestTracker::WatchersOf(WorldId world) const {
  const auto it = watchers_.find(world);
  return it == watchers_.end() ? std::span<Session* const>() : it->second;
}

Interest InterestTracker::Combine(const std::shared_ptr<World>& world) {
  Interest interest{.world = world, .shard = shard_, .poses = {}};
  std::vector<Session*>& watchers = watchers_[world->id];
  watchers.clear();
  for (const auto& [id, session] : sessions_) {
    const bool events = session->stream().WantsEvents(world->id);
    const bool movements = session->stream().WantsMovements(world->id);
    bool is_watcher = events || movements;
    interest.events |= events;
    interest.movements |= movements;
    interest.movement_regions |= session->stream().WantsMovementRegions(world->id);
    for (const PoseMode mode : kSentModes) {
      const SendInterval interval = session->stream().IntervalOf(world->id, mode);
      SendInterval& combined = interest.poses[ModeIndex(mode)].interval;
      is_watcher |= interval != SendInterval{};
      combined.all = std::gcd(combined.all, interval.all);
      combined.subset = std::gcd(combined.subset, interval.subset);
    }
    if (is_watcher) watchers.push_back(session.get());
  }
  if (watchers.empty()) watchers_.erase(world->id);
  return interest;
}

void InterestTracker::Update(const std::shared_ptr<World>& world) {
  Interest interest = Combine(world);
  const bool is_watched = watchers_.contains(world->id);
  const auto sent = sent_.find(world->id);
  if (sent == sent_.end()) {
    if (!is_watched) return;
    changed_selections_.insert(world->id);
    sent_[world->id] = interest;
    broadcast_(interest);
    return;
  }
  changed_selections_.insert(world->id);
  bool is_same = sent->second.events == interest.events &&
                 sent->second.movements == interest.movements &&
                 sent->second.movement_regions == interest.movement_regions;
  for (std::size_t mode = 0; mode < kSentModes.size(); ++mode) {
    const PoseInterest& before = sent->second.poses[mode];
    is_same &= before.interval == interest.poses[mode].interval;
    // Selections are sent only by SendChangedSelections. Until then, the previous one is used. It
    // lacks only avatars and regions that were selected after it was sent.
    interest.poses[mode].avatars = before.avatars;
    interest.poses[mode].regions = before.regions;
  }
  if (is_same) return;
  if (is_watched) {
    sent->second = interest;
  } else {
    interest.poses = {};
    sent_.erase(sent);
  }
  STRIDEWIRE_CHECK(sent_.contains(world->id) == watchers_.contains(world->id));
  broadcast_(interest);
}

void InterestTracker::SendChangedSelections() {
  for (const WorldId world : std::exchange(changed_selections_, {})) {
    const auto sent = sent_.find(world);
    if (sent == sent_.end()) continue;
    bool is_same = true;
    for (const PoseMode mode : kSentModes) {
      IdSet ids;
      std::vector<RegionFilter> regions;
      for (const Session* session : WatchersOf(world)) {
        ids.Add(session->stream().SelectedAvatars(world, mode));
        if (const auto filter = session->stream().FilterOf(world, mode)) regions.push_back(*filter);
      }
      const auto update = [&]<typename List>(std::shared_ptr<const List>& known, List&& list) {
        if (known == nullptr ? list.empty() : *known == list) return;
        is_same = false;
        known = std::make_shared<const List>(std::forward<List>(list));
      };
      PoseInterest& poses = sent->second.poses[ModeIndex(mode)];
      update(poses.avatars, ids.Take());
      update(poses.regions, std::move(regions));
    }
    if (!is_same) broadcast_(sent->second);
  }
}

}  // namespace stridewire::server
