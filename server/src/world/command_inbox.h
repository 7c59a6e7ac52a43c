#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <vector>

#include "world/shard_messages.h"

namespace stridewire::server {

/// The commands that wait for the next tick of a shard, in the order of arrival.
///
/// Spawning many avatars takes longer than a tick. The inbox therefore limits the spawns per tick
/// and divides them evenly among the sessions that spawn. The rest of a Spawn waits for the next
/// tick, together with all later commands of the same session except TerrainPart. Commands of other
/// sessions are not delayed.
class CommandInbox {
 public:
  explicit CommandInbox(std::size_t max_spawns_per_tick)
      : max_spawns_per_tick_(max_spawns_per_tick) {}

  void Push(WorldCommand&& command) { commands_.push_back(std::move(command)); }

  using Execute = std::function<CommandResult(const WorldCommand&)>;
  /// Receives the result of a command that shard `from_shard` has posted. Not called for commands
  /// with seq 0.
  using OnResult = std::function<void(int from_shard, CommandResult&&)>;

  /// Executes the commands of one tick. A Spawn that takes several ticks has one result, at its
  /// end. Returns the number of avatars of newly arrived Spawns that have to wait.
  [[nodiscard]] std::size_t Run(const Execute& execute, const OnResult& on_result);

 private:
  std::size_t max_spawns_per_tick_;
  std::vector<WorldCommand> commands_;
  // Results of Spawns that take several ticks.
  std::map<SessionId, CommandResult> partial_results_;
};

}  // namespace stridewire::server
