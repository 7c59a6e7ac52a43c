#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "pose_history.h"
#include "runtime/avatar/avatar_replica.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::client {

/// Who takes the poses that a ReplicaSet makes.
class PoseSink {
 public:
  virtual ~PoseSink() = default;
  virtual void Show(protocol::AvatarId avatar, std::uint16_t shard, const PoseStamp& stamp,
                    ConstPoseSpan pose) = 0;
  virtual void Gone(protocol::AvatarId avatar) = 0;
  /// Others are not evaluated. Who is wanted only later is shown from the next state on.
  [[nodiscard]] virtual bool Wants(protocol::AvatarId) const { return true; }
};

/// The avatars of a world, evaluated here from what they are told to begin (protocol/STANDARD.md,
/// "Movement records"): bit by bit the server's poses of its ticks. Where a message is missing
/// nothing is known of a shard's avatars until their states come.
class ReplicaSet {
 public:
  /// More shards than this in one world are refused.
  static constexpr std::size_t kMaxShards = 1024;

  /// At most `max_avatars`, others are left out; each takes some 10 KB.
  ReplicaSet(std::shared_ptr<const MotionLibrary> library, double tick_s, std::size_t max_avatars);

  /// Takes in one message and shows what it makes known. kMalformed and others: a record that is
  /// none, or of another library.
  [[nodiscard]] Status Take(const protocol::Movements& message, PoseSink& screen);

  [[nodiscard]] const MotionLibrary& library() const { return *library_; }
  [[nodiscard]] std::size_t avatar_count() const;

 private:
  struct Told {
    std::unique_ptr<AvatarReplica> replica;
    bool is_new = true;  // no pose of it was shown
  };
  struct Shard {
    bool is_known = false;
    std::uint64_t step = 0;         // the last that is complete
    std::uint16_t parts_taken = 0;  // of the next one
    std::map<protocol::AvatarId, Told> avatars;
  };

  [[nodiscard]] Status Apply(const protocol::Movements& message, std::size_t i, Shard& shard,
                             PoseSink& screen);
  void Show(const protocol::Movements& message, protocol::AvatarId avatar, Told& told,
            PoseSink& screen);

  std::shared_ptr<const MotionLibrary> library_;
  double tick_s_;
  std::size_t max_avatars_;
  std::map<std::uint16_t, Shard> shards_;
  std::vector<AvatarReplica*> scratch_;
  SoaPoseEvaluator evaluator_;
  FootPlanScratch plan_scratch_;
};

}  // namespace stridewire::client
