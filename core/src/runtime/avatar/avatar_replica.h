#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "runtime/avatar/avatar_body.h"
#include "runtime/pose/soa_pose_evaluator.h"
#include "stridewire/base/error.h"

namespace stridewire {

/// A copy of an avatar that another program simulates. It receives movement records (see
/// movement_record.h) and evaluates the same poses, bit for bit, in the same ticks. Not
/// thread-safe; one owner. Allocates only in its constructor.
///
/// For each tick, call Apply with the record of the tick, if there is one, and then AdvanceAll with
/// the length of the avatar's tick.
class AvatarReplica {
 public:
  /// The replica is unknown until it receives a state. `library` must be the avatar's library.
  explicit AvatarReplica(std::shared_ptr<const MotionLibrary> library);

  /// True if a record contains a whole state, false if it contains a change.
  [[nodiscard]] static bool IsState(std::span<const std::byte> record);

  /// Applies the record of a tick. No change may be skipped; a state may arrive at any time.
  ///
  /// kMalformed: the record is invalid, or does not fit the library or the current state.
  /// kNotFound: a change arrived before any state. The index of an error is the offset in the
  /// record. After an error the replica is unknown until the next state.
  [[nodiscard]] Status Apply(std::span<const std::byte> record, FootPlanScratch& scratch);

  /// Advances replicas by one tick and evaluates their poses. All must have the same library.
  /// Unknown replicas are skipped.
  static void AdvanceAll(std::span<AvatarReplica* const> replicas, double dt_s,
                         SoaPoseEvaluator& evaluator);

  /// True if the replica has received a state and no error occurred since.
  [[nodiscard]] bool is_known() const { return is_known_; }
  /// The displayed pose in world space, after AdvanceAll. Undefined while the replica is unknown.
  [[nodiscard]] ConstPoseSpan pose() const { return body_.DisplayedPose(); }
  /// AvatarSimulation::idle() of the avatar: it stands and has no queued requests.
  [[nodiscard]] bool idle() const { return is_idle_; }
  /// The current movement, or null while standing.
  [[nodiscard]] const Movement* movement() const { return is_moving_ ? &body_.movement : nullptr; }
  [[nodiscard]] const MotionLibrary& library() const { return *body_.library; }

 private:
  class Reader;
  void ReadChange(unsigned flags, Reader& reader, FootPlanScratch& scratch);
  void ReadState(unsigned flags, Reader& reader);

  AvatarBody body_;
  double movement_time_s_ = 0.0;
  bool is_known_ = false;
  bool is_moving_ = false;
  bool is_idle_ = false;
  // The last record set the movement time (or the layers) for the next tick, so AdvanceAll must not
  // advance it.
  bool is_time_set_ = false;
  bool are_layers_set_ = false;
};

}  // namespace stridewire
