#include "world/world_terrain.h"

#include <vector>

#include "world/convert.h"

namespace stridewire::server {

Expected<std::shared_ptr<const WorldTerrain>> MakeWorldTerrain(
    protocol::WorldId world, std::shared_ptr<const Terrain> terrain, protocol::Encoder& encoder) {
  protocol::WorldTerrain message{.world = world, .terrain = {}};
  if (terrain != nullptr) message.terrain = ToWire(terrain->data());
  auto frame = std::make_shared<std::vector<std::byte>>();
  if (Status status = encoder.Encode(message, *frame); !status) {
    return std::unexpected(std::move(status.error()));
  }
  return std::make_shared<const WorldTerrain>(WorldTerrain{std::move(terrain), std::move(frame)});
}

}  // namespace stridewire::server
