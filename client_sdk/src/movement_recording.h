#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "crowd_pose.h"
#include "movement_evaluator.h"
#include "runtime/avatar/avatar_replica.h"

namespace stridewire::client {

/// Records the movements of avatars instead of their evaluated poses. A movement takes about as
/// much memory as its poses in compact form, but nothing has to be encoded in each tick. The poses
/// are evaluated when they are needed, and equal the original ones except for rounding of the time.
class MovementRecording {
 public:
  /// Identifies the last recorded movement of an avatar. The caller keeps one cursor per avatar.
  struct Cursor {
    std::uint64_t recording = 0;  ///< Number of the recording; 0: no movement is recorded.
    std::uint32_t movement = 0;   ///< PlayedMovement::number
    bool standing = false;
    std::uint64_t begin_tick = 0;
    double begin_s = 0.0;  ///< Time of the movement at `begin_tick`.
  };

  /// A movement is stored again after this many ticks, so that the oldest ones can be removed even
  /// if an avatar continues the same movement for a long time.
  static constexpr std::uint64_t kMaxTicks = 120;

  /// Records the pose of an avatar that has a movement and no layers, at `time_s` in the movement.
  /// Stores the movement unless the pose continues the one of `cursor`. `tick_s` is the length of a
  /// tick. Ticks must not decrease, except for small differences between shards. While a movement
  /// continues, fewer than kMaxTicks successive ticks may be omitted.
  void Add(protocol::AvatarId avatar, const PoseStamp& stamp,
           const std::shared_ptr<const PlayedMovement>& movement, double time_s,
           const std::shared_ptr<const MotionLibrary>& library, double tick_s, Cursor& cursor);

  /// Evaluates the poses of these avatars in a tick and writes them to `out` from index `at` on.
  /// Returns the number of poses. Omits avatars that were not recorded. `avatars` must be in
  /// ascending order.
  std::size_t Evaluate(std::uint64_t tick, std::span<const protocol::AvatarId> avatars,
                       CrowdPose& out, std::size_t at);

  /// Removes movements that are not needed for `tick` or later ticks.
  void DropBefore(std::uint64_t tick);
  void Clear();

  /// Returns a number that changes when all movements are removed, which invalidates all cursors.
  [[nodiscard]] std::uint64_t number() const { return number_; }
  /// Returns the memory of the recorded movements in bytes.
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  struct Span {
    protocol::AvatarId avatar = 0;
    std::uint8_t flags = 0;  ///< CrowdFlags of the pose at `begin_tick`.
    std::uint64_t begin_tick = 0;
    double begin_s = 0.0;
    double tick_s = 0.0;
    std::shared_ptr<const PlayedMovement> movement;
    std::size_t bytes = 0;
  };

  std::shared_ptr<const MotionLibrary> library_;
  std::optional<MovementEvaluator> evaluator_;  // Has a value after the first evaluation.
  // In ascending order of begin_tick, except for small differences between shards.
  std::deque<Span> spans_;
  std::uint64_t number_ = 1;
  std::size_t bytes_ = 0;
  std::vector<const Span*> found_;  // Scratch memory of Evaluate.
};

}  // namespace stridewire::client
