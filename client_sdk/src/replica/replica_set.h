#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "pose_stamp.h"
#include "runtime/avatar/avatar_replica.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::client {

/// Receives the poses that a ReplicaSet evaluates.
class PoseSink {
 public:
  virtual ~PoseSink() = default;

  /// Called when an avatar has a new pose, replica.pose(). `replica` is valid until the call
  /// returns. If the avatar has a movement and no layers, the function may return true. The sink
  /// then continues the movement itself, and the set does not advance the replica until its next
  /// record.
  virtual bool OnPose(protocol::AvatarId avatar, std::uint16_t shard, const PoseStamp& stamp,
                      const AvatarReplica& replica) = 0;

  /// Called instead of OnPose while the sink continues the movement of an avatar. The set then does
  /// not read the replica, which avoids cache misses.
  virtual void OnContinued(protocol::AvatarId) {}

  /// Returns the avatars whose movements the sink no longer continues, and forgets them. The set
  /// calls OnPose for them in their next ticks. Called before a message is applied.
  [[nodiscard]] virtual std::vector<protocol::AvatarId> TakeEnded() { return {}; }

  /// Called before OnPose for the same avatars in the same order, so that the sink can prefetch
  /// what OnPose reads.
  virtual void Prefetch(protocol::AvatarId) {}

  /// Called when an avatar is removed or leaves the subscription, or when its state is discarded
  /// because a message is missing or invalid.
  virtual void OnGone(protocol::AvatarId avatar) = 0;

  /// Called when the state of an unknown avatar arrives. If it returns false, the set ignores the
  /// avatar until its next state.
  [[nodiscard]] virtual bool Wants(protocol::AvatarId) const { return true; }

  /// True: the sink evaluates movements without layers itself. In OnPose, it must not read
  /// replica.pose() of avatars that have a movement and no layers.
  [[nodiscard]] virtual bool EvaluatesMovements() const { return false; }

  /// The set evaluates only poses of ticks that are multiples of this number, at least 1.
  [[nodiscard]] virtual std::uint64_t EveryNTicks() const { return 1; }
};

/// Evaluates the avatars of one world from movement records (protocol/STANDARD.md, "Movement
/// records"). The poses are bit-identical to the server's poses of the same ticks.
///
/// - If a message of changes follows the previous message, the set applies its records. After the
///   last part of a step, it advances all avatars of the shard by one tick.
/// - A message of states contains the complete states of avatars that the client does not know yet.
/// - If a message is missing or invalid, the set discards all avatars of the shard until the server
///   sends their states.
///
/// Used by the client library and by stridewire-load. Not thread-safe.
class ReplicaSet {
 public:
  /// Maximum number of shards. A message from any further shard is an error.
  static constexpr std::size_t kMaxShards = 1024;

  /// Evaluates at most `max_avatars` avatars and ignores further ones. Each takes about 13 KB.
  ReplicaSet(std::shared_ptr<const MotionLibrary> library, double tick_s, std::size_t max_avatars);

  /// Applies one message and passes the resulting poses to `sink`. Fails with kLimitExceeded if
  /// there are too many shards. Fails with the error of AvatarReplica::Apply if a record is invalid
  /// or was made with another library. An invalid record discards all avatars of the shard until
  /// the server sends their states.
  [[nodiscard]] Status Apply(const protocol::Movements& message, PoseSink& sink);

  [[nodiscard]] const std::shared_ptr<const MotionLibrary>& library() const { return library_; }
  /// Length of a tick in seconds.
  [[nodiscard]] double tick_s() const { return tick_s_; }
  [[nodiscard]] std::size_t avatar_count() const { return avatar_count_; }

 private:
  struct Avatar {
    protocol::AvatarId id = 0;
    std::unique_ptr<AvatarReplica> replica;  // Null if the avatar is gone.
    // True if the next pose must not be interpolated from the previous one.
    bool discontinuity = true;
    // True if the sink continues the movement. The replica is then at `step`.
    bool is_continued = false;
    bool is_ended = false;  // True if the sink no longer continues the movement.
    std::uint64_t step = 0;
  };
  struct Shard {
    bool is_synchronized = false;
    std::uint64_t step = 0;           // Number of the last complete step.
    std::uint16_t parts_applied = 0;  // Number of parts of the next step that have been applied.
    std::vector<Avatar> avatars;      // In ascending order of the ids.
  };

  void EndContinued(PoseSink& sink);
  void Discard(Shard& shard, PoseSink& sink);
  void Synchronize(const protocol::Movements& message, Shard& shard, PoseSink& sink);
  [[nodiscard]] Status ApplyRecord(const protocol::Movements& message, std::size_t i, Shard& shard,
                                   PoseSink& sink);
  // Advances a replica to a step if the sink has continued its movement.
  void CatchUp(Avatar& avatar, std::uint64_t step) const;
  void AdvanceDue(const protocol::Movements& message, Shard& shard, bool emits, PoseSink& sink);
  static void EmitPose(const protocol::Movements& message, Avatar& avatar, PoseSink& sink);
  void CheckAvatarCount() const;

  std::shared_ptr<const MotionLibrary> library_;
  double tick_s_;
  std::size_t max_avatars_;
  std::size_t avatar_count_ = 0;  // Number of avatars of all shards.
  std::map<std::uint16_t, Shard> shards_;
  std::vector<AvatarReplica*> replicas_;  // Scratch memory: replicas of the avatars in `due_`.
  std::vector<Avatar*> due_;              // Scratch memory: the avatars that advance.
  ReplicaEvaluator evaluator_;
  FootPlanScratch plan_scratch_;
};

}  // namespace stridewire::client
