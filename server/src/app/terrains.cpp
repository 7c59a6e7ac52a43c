#include "app/terrains.h"

#include <utility>

#include "offline/choreography/terrain_file.h"
#include "world/world_terrain.h"

namespace stridewire::server {

Expected<Terrains> Terrains::Load(const Config& config) {
  Terrains terrains;
  protocol::Encoder encoder({config.limits.max_control_bytes, config.limits.max_bulk_bytes});
  for (const auto& [name, world] : config.worlds) {
    if (world.terrain.empty() || terrains.terrains_.contains(world.terrain)) continue;
    auto terrain = ReadTerrain(world.terrain);
    if (!terrain) return std::unexpected(std::move(terrain.error()));
    if (!MakeWorldTerrain(1, *terrain, encoder)) {
      return Fail(ErrorCode::kLimitExceeded,
                  "the terrain does not fit into a message (max_bulk_bytes)", world.terrain);
    }
    terrains.Add(world.terrain, *std::move(terrain));
  }
  return terrains;
}

std::shared_ptr<const Terrain> Terrains::Find(const std::string& file) const {
  const auto it = terrains_.find(file);
  return it == terrains_.end() ? nullptr : it->second;
}

}  // namespace stridewire::server
