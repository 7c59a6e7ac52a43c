#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <vector>

#include "session/session.h"
#include "world/shard_messages.h"

namespace stridewire::server {

/// Combines the data needs of all sessions of one shard into an Interest per world. Sends an
/// Interest to all shards when it changes.
class InterestTracker {
 public:
  using Sessions = std::map<SessionId, std::unique_ptr<Session>>;
  using Broadcast = std::function<void(const Interest&)>;

  /// Borrows `sessions`. `broadcast` must deliver an Interest to all shards.
  InterestTracker(int shard, const Sessions& sessions, Broadcast broadcast);

  /// Must be called when a session needs more or less data of `world` than before. If the combined
  /// interest has changed, sends it at once. Changes of selected avatars and regions are delayed
  /// until SendChangedSelections.
  void Update(const std::shared_ptr<World>& world);

  /// Must be called when a session has changed only its selected avatars or its region. The next
  /// SendChangedSelections sends the change, because many sessions may change in one tick.
  void SelectionChanged(WorldId world) { changed_selections_.insert(world); }
  void SendChangedSelections();

  /// Returns the sessions that need poses, movements or events of a world.
  [[nodiscard]] std::span<Session* const> WatchersOf(WorldId world) const;

 private:
  [[nodiscard]] Interest Combine(const std::shared_ptr<World>& world);

  int shard_;
  const Sessions& sessions_;
  Broadcast broadcast_;
  std::map<WorldId, std::vector<Session*>> watchers_;
  // Interests as last broadcast; one entry per world with watchers.
  std::map<WorldId, Interest> sent_;
  std::set<WorldId> changed_selections_;
};

}  // namespace stridewire::server
