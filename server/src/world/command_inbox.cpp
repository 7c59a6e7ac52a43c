#include "world/command_inbox.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

#include "base/check.h"

namespace stridewire::server {
namespace {

// Removes all items after the first `count` and returns them.
std::vector<SpawnPart::Item> SplitOff(SpawnPart& spawn, std::size_t count) {
  if (spawn.items.size() <= count) return {};
  const auto first = spawn.items.begin() + static_cast<std::ptrdiff_t>(count);
  std::vector<SpawnPart::Item> rest(std::make_move_iterator(first),
                                    std::make_move_iterator(spawn.items.end()));
  spawn.items.erase(first, spawn.items.end());
  return rest;
}

}  // namespace

std::size_t CommandInbox::Run(const Execute& execute, const OnResult& on_result) {
  std::map<SessionId, std::size_t> spawns_left;
  for (const WorldCommand& command : commands_) {
    if (std::holds_alternative<SpawnPart>(command.part)) spawns_left[command.session] = 0;
  }
  const std::size_t share =
      std::max<std::size_t>(1, max_spawns_per_tick_ / std::max<std::size_t>(1, spawns_left.size()));
  for (auto& [session, count] : spawns_left) count = share;

  std::size_t delayed = 0;
  std::vector<WorldCommand> waiting;
  std::set<SessionId> waiting_sessions;
  for (WorldCommand& command : commands_) {
    // A terrain must not be delayed, because all shards apply it at the same tick.
    if (waiting_sessions.contains(command.session) &&
        !std::holds_alternative<TerrainPart>(command.part)) {
      waiting.push_back(std::move(command));
      continue;
    }
    std::vector<SpawnPart::Item> rest;
    auto* spawn = std::get_if<SpawnPart>(&command.part);
    if (spawn != nullptr) {
      std::size_t& left = spawns_left.at(command.session);
      rest = SplitOff(*spawn, left);
      STRIDEWIRE_CHECK(spawn->items.size() <= left);
      left -= spawn->items.size();
    }
    CommandResult result = execute(command);
    if (const auto partial = partial_results_.find(command.session);
        spawn != nullptr && partial != partial_results_.end()) {
      STRIDEWIRE_CHECK(partial->second.seq == command.seq);
      CommandResult all = std::move(partial->second);
      all.accepted += result.accepted;
      std::ranges::move(result.items, std::back_inserter(all.items));
      result = std::move(all);
      partial_results_.erase(partial);
    } else {
      delayed += rest.size();
    }
    if (!rest.empty()) {
      spawn->items = std::move(rest);
      partial_results_[command.session] = std::move(result);
      waiting_sessions.insert(command.session);
      waiting.push_back(std::move(command));
    } else if (command.seq != 0) {
      on_result(command.from_shard, std::move(result));
    }
  }
  commands_ = std::move(waiting);
  STRIDEWIRE_CHECK(partial_results_.size() <= commands_.size());
  return delayed;
}

}  // namespace stridewire::server
