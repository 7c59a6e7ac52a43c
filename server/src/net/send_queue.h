#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <vector>

#include "net/shared_frame.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::server {

using protocol::WorldId;

/// The frames of one pose batch: poses of one world, mode, shard and tick.
struct PoseFrames {
  WorldId world = 0;
  protocol::PoseMode mode = protocol::PoseMode::kFull;
  int shard = 0;
  std::uint64_t avatar_count = 0;  ///< Number of avatars in all frames together.
  std::vector<SharedFrame> frames;
};

/// Messages that wait to be sent over one connection.
///
///   control     [Reply][Events][Pong]...                        limited by a budget of bytes
///   terrain     world 1: [WorldTerrain]                         one frame per world
///   movements   [world 1, shard 0][world 1, shard 1]...         limited by a second budget
///   poses       world 1, quantised, shard 0: [tick 7][tick 8]   limited by a number of ticks;
///               world 1, quantised, shard 1: [tick 7]           a new tick replaces the oldest
///
/// Control and movement messages keep their order and none may be missing. If the movement budget
/// is exceeded, the queue drops all movements of the world and shard, and the caller must send new
/// states.
///
/// Every write takes control messages, movements and poses, in the order of the sketch, so that no
/// kind starves. Terrain waits until no control message is left, because it belongs to a WorldInfo
/// that is sent as control.
///
/// Memory is bounded. Events that exceed the control budget are rejected. While many replies wait,
/// the session reads no commands. Frames are shared by all connections that send them.
class SendQueue {
 public:
  /// Creates an empty queue. Movements have a second budget of `control_budget_bytes`.
  SendQueue(std::size_t control_budget_bytes, int backlog_ticks);

  /// Always accepts the frame. The caller must keep control_bytes() within its limit.
  void PushControl(SharedFrame frame);

  /// Returns false and does not accept the frame if it would exceed the control budget.
  [[nodiscard]] bool PushEvents(SharedFrame frame);

  /// Accepts a batch. Returns how many waiting frames of older batches were dropped for it.
  [[nodiscard]] std::size_t PushPoses(PoseFrames&& batch);

  /// Accepts the terrain of a world. It replaces a waiting frame of the same world.
  void PushTerrain(WorldId world, SharedFrame frame);
  void DropTerrain(WorldId world) { terrains_.erase(world); }

  /// Accepts a Movements frame and returns 0. If it would exceed the budget, rejects it, drops the
  /// waiting movements of this world and shard, and returns how many frames were lost.
  [[nodiscard]] std::size_t PushMovements(WorldId world, int shard, SharedFrame frame);
  void DropMovements(WorldId world);

  void DropPoses(WorldId world, protocol::PoseMode mode);
  void DropAllPoses();

  /// The frames of one write, in the order in which they are sent.
  struct Gathered {
    std::vector<SharedFrame> frames;
    /// Number of frames at the end of `frames` that contain movements or poses.
    std::size_t stream_frames = 0;
    std::size_t bytes = 0;
    std::uint64_t poses = 0;    ///< Poses of the batches whose last frame is in `frames`.
    std::uint64_t batches = 0;  ///< Number of frames of pose batches.
    void clear();
  };

  /// Clears `out` and moves waiting frames to it: control messages, one terrain if no control
  /// message is left, then movements, then poses. Of control messages, movements and poses, takes
  /// frames until there are at least `max_bytes` or 64 frames of the kind. The last frame may
  /// therefore exceed `max_bytes`.
  void Gather(std::size_t max_bytes, Gathered& out);

  [[nodiscard]] bool empty() const {
    return control_.empty() && terrains_.empty() && movements_.empty() && waiting_pose_frames_ == 0;
  }
  [[nodiscard]] bool control_empty() const { return control_.empty(); }
  [[nodiscard]] std::size_t control_bytes() const { return control_bytes_; }
  [[nodiscard]] std::size_t movement_bytes() const { return movement_bytes_; }
  [[nodiscard]] std::size_t waiting_pose_frames() const { return waiting_pose_frames_; }

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
  /// Waiting batches of one world, mode and shard, oldest first.
  using Lane = std::deque<Batch>;
  struct QueuedMovements {
    WorldId world = 0;
    int shard = 0;
    SharedFrame frame;
  };
  template <typename Predicate>
  std::size_t EraseMovements(Predicate&& predicate);

  std::size_t control_budget_bytes_;
  std::size_t backlog_ticks_;
  std::deque<SharedFrame> control_;
  std::size_t control_bytes_ = 0;
  std::map<WorldId, SharedFrame> terrains_;
  std::deque<QueuedMovements> movements_;
  std::size_t movement_bytes_ = 0;
  std::map<LaneKey, Lane> lanes_;
  std::size_t waiting_pose_frames_ = 0;  // In all lanes.
  LaneKey last_lane_;                    // Lane at which the last Gather stopped.
};

}  // namespace stridewire::server
