#pragma once

#include <memory>
#include <string>

#include "ops/config.h"
#include "ops/metrics.h"
#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/pose_rows.h"
#include "world/shard_messages.h"
#include "world/tick_clock.h"
#include "world/world.h"

namespace stridewire::server {

/// What a session needs of the shard it lives on. All calls come from the shard's thread and
/// return at once; answers come later.
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

  /// Passes a command to the shard its avatars live on; Session::OnResult hears of it.
  virtual void Submit(int shard, WorldCommand&& command) = 0;
  /// Asks the shard an avatar lives on; Session::OnInspected hears of it.
  virtual void Ask(int shard, Inspection&& question) = 0;
  /// Asks a shard for states of its avatars; Session::OnStates hears of it.
  virtual void Ask(int shard, StatesQuestion&& question) = 0;
  /// Session::OnJoined hears of it.
  virtual void JoinWorld(SessionId session, protocol::Seq seq, std::string name) = 0;
  virtual void LeaveWorld(WorldId world) = 0;
  /// A ground is made of it; Session::OnResult hears of it from every shard, or once
  /// Session::OnTerrainRefused.
  virtual void SetTerrain(TerrainChange&& change) = 0;
  /// The session is to be destroyed, but not before this returns.
  virtual void SessionEnded(SessionId session) = 0;
  /// What a session wants of this world has changed.
  virtual void InterestChanged(const std::shared_ptr<World>& world) = 0;
  /// Only where its region is has.
  virtual void RegionMoved(WorldId world) = 0;
};

}  // namespace stridewire::server
