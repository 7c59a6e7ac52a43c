#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "runtime/avatar/avatar_body.h"
#include "runtime/pose/soa_pose_evaluator.h"

namespace stridewire {

/// Shows an avatar that lives elsewhere: is told what it begins (MovementRecord) and evaluates the same poses,
/// bit by bit, in the same ticks. Not thread-safe; one owner. Allocates when it is made only.
///
///   for each tick:  Apply the record of the tick, if there is one;  AdvanceAll by the length of the avatar's tick
class AvatarReplica {
 public:
  /// Nothing is known of the avatar until a state comes. The library is that of the avatar.
  explicit AvatarReplica(std::shared_ptr<const MotionLibrary> library);

  /// Whether a record tells a state, and not a change.
  [[nodiscard]] static bool IsState(std::span<const std::byte> record);

  /// Takes the record of a tick. Of the changes none may be left out; a state may come at any time.
  /// kMalformed: bytes that are none, or do not fit the library or what is known; kNotFound: a change, and no state was
  /// there before. `index`: where in the record. Nothing is known then until the next state.
  [[nodiscard]] Status Apply(std::span<const std::byte> record);

  /// Goes on by one tick of the avatars', and shows it. All have the same library; those of which nothing is known stay
  /// so.
  static void AdvanceAll(std::span<AvatarReplica* const> replicas, double dt_s,
                         SoaPoseEvaluator& evaluator);

  [[nodiscard]] bool is_known() const { return is_known_; }
  /// Displayed after AdvanceAll, in the world; anything while nothing is known.
  [[nodiscard]] ConstPoseSpan pose() const { return body_.Shown(); }
  /// As the avatar's idle(): stands, and has nothing else to do.
  [[nodiscard]] bool idle() const { return is_idle_; }
  /// The movement under way, null while standing.
  [[nodiscard]] const Movement* movement() const { return is_moving_ ? &body_.movement : nullptr; }
  [[nodiscard]] const MotionLibrary& library() const { return *body_.library; }

 private:
  class Reader;
  void ReadChange(unsigned flags, Reader& reader);
  void ReadState(unsigned flags, Reader& reader);

  AvatarBody body_;
  double movement_time_s_ = 0.0;
  bool is_known_ = false;
  bool is_moving_ = false;
  bool is_idle_ = false;
  bool is_told_ = false;          // of the tick that comes: its time needs no adding
  bool are_layers_told_ = false;  // the same of the layers
};

}  // namespace stridewire
