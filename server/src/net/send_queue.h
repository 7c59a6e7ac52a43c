#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <vector>

#include "net/shared_frame.h"
#include "world/shard_messages.h"

namespace stridewire::server {

/// What waits to be sent over one connection: control messages in order, and of poses the latest.
///
///   control   [Reply][Events][Pong]…                     a budget of bytes
///   lane      world 1, quantised, shard 0: [tick 7][tick 8]   a backlog of ticks; a new tick
///   lane      world 1, quantised, shard 1: [tick 7]           drives out the oldest
///
/// Movements of avatars wait in order, as control does, and in their own budget of the same size; none may be missing, so
/// beyond it all of a world and shard go.
///
/// Control goes first, then grounds (behind the WorldInfo that they belong to), but every write also
/// takes poses, so neither starves the other. Memory is bounded: control by its budget (events
/// beyond it are refused; replies are bounded by whoever stops reading commands), grounds by one a
/// world and poses by lanes times backlog, both in frames that all observers share.
class SendQueue {
 public:
  SendQueue(std::size_t control_budget_bytes, int backlog_ticks);

  /// Always taken. The caller keeps an eye on control_bytes().
  void PushControl(SharedFrame frame);

  /// False, and not taken, when it would exceed the control budget.
  [[nodiscard]] bool PushEvents(SharedFrame frame);

  /// Takes a batch; returns how many frames of older ones it drove out.
  [[nodiscard]] std::size_t PushPoses(const PoseDelivery& delivery);

  /// Takes a world's ground in place of one that still waits: the last is what holds.
  void PushTerrain(WorldId world, SharedFrame frame);
  void DropTerrain(WorldId world) { grounds_.erase(world); }

  /// Takes what avatars began. Beyond the budget it is not taken, and what waits of the world and shard is forgotten:
  /// returns how many frames went, 0: taken.
  [[nodiscard]] std::size_t PushMovements(WorldId world, int shard, SharedFrame frame);
  /// Forgets the movements of a world.
  void DropMovements(WorldId world);

  /// Forgets the poses of a world, or of all.
  void DropPoses(WorldId world, protocol::PoseMode mode);
  void DropAllPoses();

  /// What one write takes, in the order to be sent.
  struct Gathered {
    std::vector<SharedFrame> frames;
    std::size_t bytes = 0;
    std::uint64_t poses = 0;
    std::uint64_t batches = 0;
    void clear();
  };

  /// Moves frames to `out`, which is cleared first: control until `max_bytes`, a ground if no
  /// control waits any more, then movements until `max_bytes` more, and as much of poses, lane after
  /// lane; of each at least one frame that waits.
  void Gather(std::size_t max_bytes, Gathered& out);

  [[nodiscard]] bool empty() const {
    return control_.empty() && grounds_.empty() && movements_.empty() && waiting_batches_ == 0;
  }
  [[nodiscard]] bool control_empty() const { return control_.empty(); }
  [[nodiscard]] std::size_t control_bytes() const { return control_bytes_; }
  [[nodiscard]] std::size_t movement_bytes() const { return movement_bytes_; }
  [[nodiscard]] std::size_t waiting_batches() const { return waiting_batches_; }

 private:
  struct LaneKey {
    WorldId world = 0;
    protocol::PoseMode mode = protocol::PoseMode::kFull;
    int shard = 0;
    auto operator<=>(const LaneKey&) const = default;
  };
  struct Batch {
    std::vector<SharedFrame> parts;
    std::size_t next_part = 0;
    std::uint64_t avatars = 0;
    [[nodiscard]] std::size_t left() const { return parts.size() - next_part; }
  };
  using Lane = std::deque<Batch>;

  std::size_t control_budget_bytes_;
  std::size_t backlog_ticks_;
  std::deque<SharedFrame> control_;
  std::size_t control_bytes_ = 0;
  std::map<WorldId, SharedFrame> grounds_;
  struct Told {
    WorldId world = 0;
    int shard = 0;
    SharedFrame frame;
  };
  template <typename IsIt>
  std::size_t EraseMovements(IsIt&& is_it);
  std::deque<Told> movements_;
  std::size_t movement_bytes_ = 0;
  std::map<LaneKey, Lane> lanes_;
  std::size_t waiting_batches_ = 0;
  LaneKey last_lane_;  // where the last gathering stopped
};

}  // namespace stridewire::server
