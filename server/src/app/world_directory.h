#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "app/libraries.h"
#include "app/terrains.h"
#include "base/config.h"
#include "base/refusal.h"
#include "world/world.h"

namespace stridewire::server {

/// Lists all worlds. A world is created when the first session joins it, and removed when it has no
/// sessions and no avatars. Owned by the main thread; not thread-safe.
class WorldDirectory {
 public:
  /// Borrows all references.
  WorldDirectory(const Config& config, const Libraries& libraries, const Terrains& terrains)
      : config_(config),
        libraries_(libraries),
        terrains_(terrains),
        encoder_({config.limits.max_control_bytes, config.limits.max_bulk_bytes}) {}

  /// Adds a member to a world and creates the world if necessary. `name` must be a valid name of a
  /// world. Fails with kNoSuchWorld if the world is not configured and open_worlds is false, or
  /// kLimitReached if there are max_worlds worlds.
  [[nodiscard]] Outcome<std::shared_ptr<World>> Join(std::string_view name);

  /// Removes a member. The world must exist and have members.
  void Leave(WorldId id);

  /// Sets the terrain of a world; nullopt: flat ground. Returns the terrain with its encoded
  /// message. Fails with kOutOfRange if the terrain is invalid and kLimitReached if it is too
  /// large.
  [[nodiscard]] Outcome<std::shared_ptr<const WorldTerrain>> SetTerrain(
      World& world, std::optional<protocol::TerrainInfo>&& terrain);

  /// Removes worlds that have neither members nor avatars. Returns their ids.
  [[nodiscard]] std::vector<WorldId> DropEmpty();

  /// Calls `function(const World&)` for each world, in the order of names.
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
