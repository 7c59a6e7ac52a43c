#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "world/shard_messages.h"

namespace stridewire::server {

/// The movements of the avatars of one world and shard that one client receives in movement mode.
///
/// A client needs the state of an avatar before it can use the avatar's movements. The feed
/// therefore keeps track of the avatars whose states are still missing, and requests them in
/// portions, one request at a time:
///
///   up to date --SetAvatars--> needs states --NextRequest--> request pending --OnStates--+
///        ^                          ^                                                    |
///        |                          +----------- if avatars are left --------------------+
///        +-------------------------------------- otherwise ------------------------------+
///
/// If the send queue drops movements, the feed is lost: the client notices the missing step and
/// discards all avatars. Restart then sends all states again.
class MovementFeed {
 public:
  explicit MovementFeed(std::shared_ptr<World> world) : world_(std::move(world)) {}

  /// Selects the avatars (ascending ids), or all avatars of the shard if `avatars` is nullopt. New
  /// avatars need states. Once a feed has covered all avatars, it always covers them; the client
  /// then ignores the avatars that it does not need.
  void SetAvatars(std::optional<std::vector<AvatarId>> avatars);

  /// True if the client receives every step unchanged.
  [[nodiscard]] bool covers_all() const { return covers_all_; }
  /// Returns the part of `step` that concerns the selected avatars. Also reports deselected avatars
  /// as gone, up to a message size of `max_bytes`. The rest are reported with the next step.
  [[nodiscard]] protocol::Movements Select(const protocol::Movements& step, std::size_t max_bytes);

  /// Must be called when movements were dropped. The client's copies of the avatars are then
  /// invalid.
  void SetLost();
  [[nodiscard]] bool is_lost() const { return is_lost_; }
  /// Continues a lost feed. All avatars need states.
  void Restart();

  [[nodiscard]] bool needs_request() const {
    return !is_lost_ && next_ != 0 && pending_nonce_ == 0;
  }
  /// Fills in the members of `request` that depend on the feed. `nonce` must not be 0.
  void NextRequest(std::uint32_t nonce, StatesRequest& request);
  /// Returns false if `result` does not belong to the pending request.
  [[nodiscard]] bool OnStates(const StatesResult& result);

 private:
  std::shared_ptr<World> world_;
  bool covers_all_ = false;
  std::vector<AvatarId> selected_;  // ascending
  // Ascending ids of avatars that are no longer selected, but have not yet been reported to the
  // client as gone.
  std::vector<AvatarId> deselected_;
  // Ascending ids whose states are needed; null: all avatars.
  std::shared_ptr<const std::vector<AvatarId>> states_of_;
  AvatarId next_ = 0;                // First id of states_of_ whose state is missing; 0: none.
  std::uint32_t pending_nonce_ = 0;  // Nonce of the pending request; 0: none.
  bool is_lost_ = false;
};

}  // namespace stridewire::server
