// Functions of the C API that submit commands: they check the arguments, convert them to a message
// and queue it in the session.

#include <algorithm>
#include <cstring>
#include <optional>
#include <span>
#include <utility>

#include "client/request_from_c.h"
#include "client_handle.h"

using stridewire::DVec3;
using stridewire::client::InRange;
using stridewire::client::Session;
using stridewire::client::Submit;
namespace protocol = stridewire::protocol;

namespace {

bool IsList(const void* items, std::size_t count) {
  return items != nullptr && count >= 1 && count <= STRIDEWIRE_MAX_ITEMS;
}

protocol::Spawn ToSpawn(std::span<const stridewire_spawn> spawns, bool teleport) {
  protocol::Spawn message;
  message.items.reserve(spawns.size());
  for (const stridewire_spawn& s : spawns) {
    message.items.push_back(
        {s.avatar,
         {DVec3(s.position_m[0], s.position_m[1], s.position_m[2]), s.heading_rad},
         teleport});
  }
  return message;
}

bool IsTerrain(const stridewire_terrain_def& terrain) {
  constexpr std::uint32_t kMaxColumns = STRIDEWIRE_MAX_TERRAIN_COLUMNS;
  const stridewire_height_field* field = terrain.height_field;
  return (terrain.boxes != nullptr || terrain.box_count == 0) &&
         terrain.box_count <= STRIDEWIRE_MAX_TERRAIN_BOXES &&
         (field == nullptr ||
          (field->heights_m != nullptr && InRange(field->columns, 2u, kMaxColumns) &&
           InRange(field->rows, 2u, kMaxColumns)));
}

std::optional<protocol::TerrainInfo> ToTerrain(const stridewire_terrain_def& terrain) {
  std::optional<protocol::TerrainInfo> info;
  if (const stridewire_height_field* field = terrain.height_field) {
    const std::size_t count = std::size_t{field->columns} * field->rows;
    info.emplace().height_field =
        protocol::HeightFieldInfo{{field->origin_m[0], field->origin_m[1]},
                                  field->cell_m,
                                  static_cast<std::uint16_t>(field->columns),
                                  static_cast<std::uint16_t>(field->rows),
                                  {field->heights_m, field->heights_m + count}};
  }
  if (terrain.box_count > 0) {
    if (!info) info.emplace();
    info->boxes.reserve(terrain.box_count);
    for (const stridewire_terrain_box& box : std::span(terrain.boxes, terrain.box_count)) {
      info->boxes.push_back(
          {{box.min_m[0], box.min_m[1]}, {box.max_m[0], box.max_m[1]}, box.height_m});
    }
  }
  return info;
}

bool IsDetail(stridewire_pose_detail detail) {
  return InRange(detail, STRIDEWIRE_DETAIL_ALL, STRIDEWIRE_DETAIL_ROOT);
}

bool IsRegion(const stridewire_region& region) {
  return region.ring_count <= STRIDEWIRE_MAX_RATE_RINGS &&
         (region.rings == nullptr) == (region.ring_count == 0) &&
         (region.ring_details == nullptr ||
          std::all_of(region.ring_details, region.ring_details + region.ring_count, IsDetail));
}

bool IsObservation(const stridewire_observation& observation) {
  const stridewire_region* region = observation.region;
  const bool has_details =
      observation.detail != STRIDEWIRE_DETAIL_ALL ||
      (region != nullptr && region->ring_details != nullptr && region->ring_count > 0);
  return InRange(observation.mode, STRIDEWIRE_FULL, STRIDEWIRE_MOVEMENT) &&
         IsDetail(observation.detail) &&
         (!has_details || observation.mode == STRIDEWIRE_QUANTISED) &&
         observation.avatar_count <= STRIDEWIRE_MAX_ITEMS &&
         (observation.avatars == nullptr) == (observation.avatar_count == 0) &&
         (region == nullptr || IsRegion(*region));
}

protocol::Region ToRegion(const stridewire_region& region) {
  protocol::Region out{{region.x, region.z}, region.radius_m, std::nullopt, {}, {}};
  if (!(region.leave_m < 0.0)) out.leave_m = region.leave_m;
  for (std::size_t i = 0; i < region.ring_count; ++i) {
    out.rings.push_back({region.rings[i].to_m, region.rings[i].every_n_ticks});
    if (region.ring_details == nullptr) continue;
    out.ring_details.push_back(static_cast<protocol::PoseDetail>(region.ring_details[i]));
  }
  return out;
}

}  // namespace

extern "C" {

stridewire_status stridewire_client_join_world(stridewire_client* client, const char* name,
                                               stridewire_role role, stridewire_world* world,
                                               uint64_t* command) {
  if (name == nullptr || world == nullptr ||
      (role != STRIDEWIRE_CONTROLLER && role != STRIDEWIRE_OBSERVER)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    return session.JoinWorld(
        name,
        role == STRIDEWIRE_CONTROLLER ? protocol::Role::kController : protocol::Role::kObserver,
        *world, id);
  });
}

stridewire_status stridewire_client_leave_world(stridewire_client* client, stridewire_world world,
                                                uint64_t* command) {
  return Submit(client, command,
                [&](Session& session, std::uint64_t& id) { return session.LeaveWorld(world, id); });
}

stridewire_status stridewire_client_spawn(stridewire_client* client, stridewire_world world,
                                          const stridewire_spawn* spawns, size_t count,
                                          uint64_t* command) {
  if (!IsList(spawns, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    return session.Spawn(world, ToSpawn({spawns, count}, false), id);
  });
}

stridewire_status stridewire_client_teleport(stridewire_client* client, stridewire_world world,
                                             const stridewire_spawn* places, size_t count,
                                             uint64_t* command) {
  if (!IsList(places, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  for (const stridewire_spawn& place : std::span(places, count)) {
    if (place.avatar == 0) return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    return session.Spawn(world, ToSpawn({places, count}, true), id);
  });
}

stridewire_status stridewire_client_remove(stridewire_client* client, stridewire_world world,
                                           const uint32_t* avatars, size_t count,
                                           uint64_t* command) {
  if (!IsList(avatars, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    return session.Remove(world, {0, 0, {avatars, avatars + count}}, id);
  });
}

stridewire_status stridewire_client_request(stridewire_client* client, stridewire_world world,
                                            const stridewire_movement* movements, size_t count,
                                            uint64_t* command) {
  if (!IsList(movements, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  if (!std::all_of(movements, movements + count, protocol::IsMovement)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    protocol::Request message;
    message.items.reserve(count);
    for (const stridewire_movement& m : std::span(movements, count)) {
      message.items.push_back(protocol::ToRequestItem(m));
    }
    return session.Request(world, std::move(message), id);
  });
}

stridewire_status stridewire_client_cancel(stridewire_client* client, stridewire_world world,
                                           const uint32_t* avatars, size_t count,
                                           uint64_t* command) {
  if (!IsList(avatars, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    return session.Cancel(world, {0, 0, {avatars, avatars + count}}, id);
  });
}

stridewire_status stridewire_client_set_terrain(stridewire_client* client, stridewire_world world,
                                                const stridewire_terrain_def* terrain,
                                                uint64_t* command) {
  if (terrain == nullptr || !IsTerrain(*terrain)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    return session.SetTerrain(world, {0, 0, ToTerrain(*terrain)}, id);
  });
}

stridewire_status stridewire_client_set_layers(stridewire_client* client, stridewire_world world,
                                               const stridewire_layer* layers, size_t count,
                                               uint64_t* command) {
  if (!IsList(layers, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  for (const stridewire_layer& layer : std::span(layers, count)) {
    if (layer.name == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    protocol::SetLayers message;
    message.items.reserve(count);
    for (const stridewire_layer& l : std::span(layers, count)) {
      // Copies at most one byte more than a name may have, because a longer name is rejected in any
      // case.
      message.items.push_back({.avatar = l.avatar,
                               .layer = {l.name, strnlen(l.name, protocol::kMaxNameBytes + 1)},
                               .enabled = l.fade_out == 0,
                               .weight = l.weight,
                               .blend_s = l.blend_s,
                               .speed = l.speed});
    }
    return session.SetLayers(world, std::move(message), id);
  });
}

stridewire_status stridewire_client_set_planting(stridewire_client* client, stridewire_world world,
                                                 const stridewire_planting* planting,
                                                 uint64_t* command) {
  if (planting == nullptr || !IsList(planting->avatars, planting->avatar_count)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    protocol::SetPlanting message;
    message.avatars.assign(planting->avatars, planting->avatars + planting->avatar_count);
    message.enabled = planting->enabled != 0;
    return session.SetPlanting(world, std::move(message), id);
  });
}

stridewire_status stridewire_client_observe(stridewire_client* client, stridewire_world world,
                                            const stridewire_observation* observation,
                                            uint32_t* subscription, uint64_t* command) {
  if (observation == nullptr || !IsObservation(*observation)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    protocol::Observe message;
    message.mode = static_cast<protocol::PoseMode>(observation->mode);
    message.detail = static_cast<protocol::PoseDetail>(observation->detail);
    message.every_n_ticks = observation->every_n_ticks;
    message.with_events = observation->with_events != 0;
    message.avatars.assign(observation->avatars, observation->avatars + observation->avatar_count);
    if (observation->region != nullptr) message.region = ToRegion(*observation->region);
    std::uint32_t number = 0;
    const stridewire_status status = session.Observe(world, std::move(message), number, id);
    if (subscription != nullptr) *subscription = number;
    return status;
  });
}

stridewire_status stridewire_client_move_region(stridewire_client* client, uint32_t subscription,
                                                const stridewire_region* region,
                                                uint64_t* command) {
  if (region == nullptr || !IsRegion(*region)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    return session.MoveRegion(subscription, ToRegion(*region), id);
  });
}

stridewire_status stridewire_client_stop_observing(stridewire_client* client, uint32_t subscription,
                                                   uint64_t* command) {
  return Submit(client, command, [&](Session& session, std::uint64_t& id) {
    return session.StopObserving(subscription, id);
  });
}

}  // extern "C"
