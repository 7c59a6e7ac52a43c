#pragma once

#include <memory>

#include "base/config.h"
#include "base/metrics.h"
#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/pose_rows.h"
#include "world/shard_messages.h"
#include "world/tick_clock.h"
#include "world/world.h"

namespace stridewire::server {

/// The interface of a session to the shard on which it lives. All functions must be called on the
/// thread of the shard. They return at once; results arrive later.
class SessionHost {
 public:
  virtual ~SessionHost() = default;

  [[nodiscard]] virtual const Config& config() const = 0;
  [[nodiscard]] virtual int shard_index() const = 0;
  [[nodiscard]] virtual int shard_count() const = 0;
  [[nodiscard]] virtual const TickClock& clock() const = 0;
  [[nodiscard]] virtual std::uint64_t tick() const = 0;
  [[nodiscard]] virtual bool is_draining() const = 0;
  [[nodiscard]] virtual AvatarBudget& avatar_budget() = 0;
  [[nodiscard]] virtual ThreadMetrics& metrics() = 0;
  [[nodiscard]] virtual protocol::Encoder& encoder() = 0;
  [[nodiscard]] virtual protocol::PoseBatchComposer& composer() = 0;

  /// Sends a message to a shard, which may be this session's own shard. The results are passed to
  /// Session::OnResult (WorldCommand), OnInspected (InspectRequest) or OnStates (StatesRequest).
  virtual void SendToShard(int shard, ShardMessage message) = 0;
  /// Sends a message to the main thread. The result of a JoinRequest is passed to
  /// Session::OnJoined. After a TerrainChange, Session::OnResult receives one result per shard; if
  /// the terrain is refused, Session::OnTerrainRefused is called instead.
  virtual void SendToServer(ServerMessage message) = 0;
  /// Destroys an ended session after the current call has returned.
  virtual void DestroySession(SessionId session) = 0;
  /// Called when the session needs more or less data of this world than before.
  virtual void InterestChanged(const std::shared_ptr<World>& world) = 0;
  /// Called when the session has moved its region, but otherwise needs the same as before.
  virtual void SelectionChanged(WorldId world) = 0;
};

}  // namespace stridewire::server
