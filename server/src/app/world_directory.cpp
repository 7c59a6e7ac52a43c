#include "app/world_directory.h"

#include "base/check.h"
#include "world/convert.h"

namespace stridewire::server {

using protocol::StatusCode;

Outcome<std::shared_ptr<World>> WorldDirectory::Join(std::string_view name) {
  STRIDEWIRE_CHECK(IsWorldName(name));  // The decoder has checked the JoinWorld.
  if (const auto it = worlds_.find(name); it != worlds_.end()) {
    ++it->second.members;
    return it->second.world;
  }
  const auto configured = config_.worlds.find(name);
  const bool is_configured = configured != config_.worlds.end();
  if (!is_configured && !config_.open_worlds) {
    return Refuse(StatusCode::kNoSuchWorld,
                  "no world has this name, and this server does not create worlds");
  }
  if (worlds_.size() >= static_cast<std::size_t>(config_.limits.max_worlds)) {
    return Refuse(StatusCode::kLimitReached, "too many worlds on this server (max_worlds)");
  }
  auto world = std::make_shared<World>();
  world->id = ++last_id_;
  world->name = std::string(name);
  world->avatar_options.run_time_correction = config_.run_time_correction;
  world->avatar_options.foot_planting = config_.foot_planting;
  world->avatar_options.idle_motion =
      is_configured ? configured->second.idle_motion.value_or(config_.idle_motion)
                    : config_.idle_motion;
  world->avatar_options.stride_variation =
      is_configured ? configured->second.stride_variation.value_or(config_.stride_variation)
                    : config_.stride_variation;
  world->interest_cell_m = config_.interest_cell_m;
  world->persistent = is_configured ? configured->second.persistent : config_.persistent;
  const bool has_library = is_configured && !configured->second.library.empty();
  const std::string& library = has_library ? configured->second.library : config_.library;
  world->library = libraries_.Find(library);
  world->quantizations = libraries_.FindQuantizations(library);
  world->walk_speeds = libraries_.FindWalkSpeeds(library);
  STRIDEWIRE_CHECK(world->library != nullptr);  // Libraries::Load has loaded all libraries.
  if (is_configured && !configured->second.terrain.empty()) {
    auto world_terrain =
        MakeWorldTerrain(world->id, terrains_.Find(configured->second.terrain), encoder_);
    STRIDEWIRE_CHECK(world_terrain.has_value());  // Terrains::Load has checked the size.
    world->terrain.Set(*std::move(world_terrain));
  }
  worlds_.emplace(world->name, Entry{world, 1});
  return world;
}

Outcome<std::shared_ptr<const WorldTerrain>> WorldDirectory::SetTerrain(
    World& world, std::optional<protocol::TerrainInfo>&& terrain) {
  const auto refuse = [](const Error& error) {
    const bool is_limit = error.code == ErrorCode::kLimitExceeded;
    return Refuse(is_limit ? StatusCode::kLimitReached : StatusCode::kOutOfRange, Describe(error));
  };
  std::shared_ptr<const Terrain> made;
  if (terrain) {
    auto checked = Terrain::Make(FromWire(*std::move(terrain)));
    if (!checked) return refuse(checked.error());
    made = *std::move(checked);
  }
  auto world_terrain = MakeWorldTerrain(world.id, std::move(made), encoder_);
  if (!world_terrain) return refuse(world_terrain.error());
  world.terrain.Set(*world_terrain);
  return *std::move(world_terrain);
}

void WorldDirectory::Leave(WorldId id) {
  for (auto& [name, entry] : worlds_) {
    if (entry.world->id != id) continue;
    STRIDEWIRE_CHECK(entry.members > 0);
    --entry.members;
    return;
  }
  STRIDEWIRE_CHECK(false && "no world has this id");
}

std::vector<WorldId> WorldDirectory::DropEmpty() {
  std::vector<WorldId> dropped;
  std::erase_if(worlds_, [&](const auto& item) {
    const Entry& entry = item.second;
    // avatar_count includes avatars that are still being spawned.
    if (entry.members > 0 || entry.world->avatar_count.load() > 0) return false;
    dropped.push_back(entry.world->id);
    return true;
  });
  return dropped;
}

}  // namespace stridewire::server
