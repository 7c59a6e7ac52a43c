#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ops/config.h"
#include "ops/libraries.h"
#include "ops/terrains.h"
#include "session/refusal.h"
#include "world/world.h"

namespace stridewire::server {

/// Which worlds there are. One thread's; a world comes into being when it is first joined and ends
/// when nobody is in it and no avatar lives.
class WorldDirectory {
 public:
  /// Borrows all.
  WorldDirectory(const Config& config, const Libraries& libraries, const Terrains& terrains)
      : config_(config),
        libraries_(libraries),
        terrains_(terrains),
        encoder_({config.limits.max_control_bytes, config.limits.max_bulk_bytes}) {}

  /// One member more. kInvalidArgument: no name for a world; kNoSuchWorld: not configured, and
  /// worlds are not open; kLimitReached: max_worlds.
  [[nodiscard]] Outcome<std::shared_ptr<World>> Join(std::string_view name);

  /// One member less.
  void Leave(WorldId id);

  /// Gives a world the ground that was sent, null: flat; what its shards and sessions are to share.
  /// kOutOfRange, kLimitReached: it is no terrain.
  [[nodiscard]] Outcome<std::shared_ptr<const WorldTerrain>> SetTerrain(
      World& world, std::optional<protocol::TerrainInfo>&& terrain);

  /// Forgets empty worlds and says which.
  [[nodiscard]] std::vector<WorldId> DropEmpty();

  /// Calls function(const World&) for each, in order of names.
  template <typename Function>
  void ForEach(Function&& function) const {
    for (const auto& [name, entry] : worlds_) function(std::as_const(*entry.world));
  }

  [[nodiscard]] std::size_t size() const { return worlds_.size(); }

 private:
  struct Entry {
    std::shared_ptr<World> world;
    int members = 0;
  };
  const Config& config_;
  const Libraries& libraries_;
  const Terrains& terrains_;
  protocol::Encoder encoder_;
  std::map<std::string, Entry, std::less<>> worlds_;
  WorldId last_id_ = 0;
};

}  // namespace stridewire::server
