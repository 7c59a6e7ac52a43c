#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "world/shard_messages.h"

namespace stridewire::server {

/// What a client is told of the movements of the avatars of one world and shard, and how far it has the states that they go
/// on from.
class MovementFeed {
 public:
  explicit MovementFeed(std::shared_ptr<World> world) : world_(std::move(world)) {}

  /// Who it is about from now on: avatars of the shard, growing, or all. Whom it was not about before the client is
  /// to have the state of. What was once about all stays so: the client tells whom it does not want.
  void Watch(std::optional<std::vector<AvatarId>> named);

  /// Every step is told as it is.
  [[nodiscard]] bool is_whole() const { return is_whole_; }
  /// What of a step is told otherwise: of whom it is about, and that those are gone it is not about any more; of the latter as many as
  /// fit into `max_bytes`, the others with the next.
  [[nodiscard]] protocol::Movements Pick(const protocol::Movements& step, std::size_t max_bytes);

  /// Movements were not sent: the client knows of nobody by the gap.
  void Lose();
  [[nodiscard]] bool is_lost() const { return is_lost_; }
  /// It goes on, from new states of all.
  void Recover();

  /// The next question for states, if one is due.
  [[nodiscard]] bool asks() const { return !is_lost_ && next_ != 0 && asked_ == 0; }
  /// What of `question` is its own. `nonce`: not 0.
  void Ask(std::uint32_t nonce, StatesQuestion& question);
  /// False: that was not its last question.
  [[nodiscard]] bool OnStates(const StatesAnswer& answer);

 private:
  std::shared_ptr<World> world_;
  bool is_whole_ = false;
  std::vector<AvatarId> named_;  // growing
  std::vector<AvatarId>
      forgotten_;  // growing; the client does not know yet that they are not told of any more
  std::shared_ptr<const std::vector<AvatarId>> states_of_;  // growing; null: all
  AvatarId next_ = 0;    // of those, from here on they are still to be told; 0: none
  std::uint32_t asked_ = 0;  // nonce of the question under way, 0: none
  bool is_lost_ = false;
};

}  // namespace stridewire::server
