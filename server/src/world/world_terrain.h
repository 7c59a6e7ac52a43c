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

/// The ground of a world: what its avatars walk on, and the Ground that tells of it, encoded
/// once and shared by all who hear it. Immutable.
struct WorldTerrain {
  std::shared_ptr<const Terrain> terrain;  ///< Null: flat at 0.
  SharedFrame frame;
};

/// kLimitExceeded: its frame is larger than the encoder's limits allow.
[[nodiscard]] Expected<std::shared_ptr<const WorldTerrain>> MakeWorldTerrain(
    protocol::WorldId world, std::shared_ptr<const Terrain> terrain, protocol::Encoder& encoder);

/// Where threads leave each other a world's ground. Locked only when a world changes hands or
/// somebody joins, never in a tick.
class TerrainSlot {
 public:
  /// Null: flat, and never was otherwise.
  [[nodiscard]] std::shared_ptr<const WorldTerrain> Get() const {
    const std::scoped_lock lock(mutex_);
    return ground_;
  }
  void Set(std::shared_ptr<const WorldTerrain> ground) {
    const std::scoped_lock lock(mutex_);
    ground_ = std::move(ground);
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const WorldTerrain> ground_;
};

}  // namespace stridewire::server
