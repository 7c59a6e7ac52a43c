#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include "net/shared_frame.h"
#include "stridewire/base/error.h"
#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/messages.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire::server {

/// The terrain of a world and its WorldTerrain message, which is encoded once and shared by all
/// sessions. Immutable.
struct WorldTerrain {
  std::shared_ptr<const Terrain> terrain;  ///< The ground; null: flat ground at height 0.
  SharedFrame frame;
};

/// Fails with kLimitExceeded if the message exceeds the limits of the encoder.
[[nodiscard]] Expected<std::shared_ptr<const WorldTerrain>> MakeWorldTerrain(
    protocol::WorldId world, std::shared_ptr<const Terrain> terrain, protocol::Encoder& encoder);

/// The current terrain of a world, for all threads. It is locked when the terrain is set, a client
/// joins or resumes, or a WorldShard is created, but not by the ticks of a WorldShard.
class TerrainSlot {
 public:
  /// Returns null if no terrain was ever set. The ground is then flat.
  [[nodiscard]] std::shared_ptr<const WorldTerrain> Get() const {
    const std::scoped_lock lock(mutex_);
    return terrain_;
  }
  void Set(std::shared_ptr<const WorldTerrain> terrain) {
    const std::scoped_lock lock(mutex_);
    terrain_ = std::move(terrain);
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const WorldTerrain> terrain_;
};

}  // namespace stridewire::server
