#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/avatar/avatar_body.h"
#include "runtime/pose/evaluation_batcher.h"
#include "stridewire/base/error.h"

namespace stridewire {

/// Memory for AvatarReplica::AdvanceAll. All replicas with the same library may share it. Not
/// thread-safe. Allocates only in its constructor.
class ReplicaEvaluator {
 public:
  /// `library` must outlive the evaluator.
  explicit ReplicaEvaluator(const MotionLibrary& library);

 private:
  friend class AvatarReplica;
  /// Number of replicas whose movements are sorted together.
  static constexpr std::size_t kBatch = 1024;

  SoaPoseEvaluator evaluator_;
  EvaluationBatcher batcher_;
};

/// A copy of an avatar that another program simulates. It receives movement records (see
/// movement_record.h) and evaluates the same poses, bit for bit, in the same ticks. Not
/// thread-safe; one owner. Allocates only in its constructor.
///
/// For each tick, call Apply with the record of the tick, if there is one. Then call AdvanceAll
/// with the tick length of the simulation.
class AvatarReplica {
 public:
  /// A tick of AdvanceAll.
  struct Tick {
    /// Length of the tick in seconds. Must be the same until all replicas receive new states.
    double length_s = 0.0;
    std::uint64_t number = 0;  ///< Number of the tick. Must increase by 1 from tick to tick.
    bool has_poses = true;     ///< False: poses of this tick are not needed.
    /// Expected number of ticks from one pose to the next; 1: a pose in every tick. Poses of other
    /// ticks are possible, but cost more.
    int ticks_apart = 1;
    /// True: only poses with layers are needed, so replicas without layers are not evaluated.
    bool only_layered = false;
  };

  /// The avatar's state is unknown until the replica receives a record with a whole state.
  /// `library` must be the avatar's library.
  explicit AvatarReplica(std::shared_ptr<const MotionLibrary> library);

  /// Returns true if a record contains a whole state, false if it contains a change.
  [[nodiscard]] static bool IsState(std::span<const std::byte> record);

  /// Applies the record of a tick. Changes must be applied without gaps. A state may arrive at any
  /// time.
  ///
  /// Errors: kMalformed if the record is invalid, or does not fit the library or the current state.
  /// kNotFound if a change arrives while the state is unknown. Error::index is the offset in the
  /// record. After an error, the avatar's state is unknown until the next record with a whole
  /// state.
  [[nodiscard]] Status Apply(std::span<const std::byte> record, FootPlanScratch& scratch);

  /// Advances replicas by one tick and evaluates their poses if the tick has poses. All must have
  /// the same library, and each may occur only once. Replicas without a known state are skipped. A
  /// movement that does not change is evaluated for several ticks at once, so that the library is
  /// read less often. Pass replicas in the same order in every tick, because their positions in the
  /// list and the number of the tick determine in which ticks they are evaluated.
  static void AdvanceAll(std::span<AvatarReplica* const> replicas, const Tick& tick,
                         ReplicaEvaluator& evaluator);

  /// Does the same as AdvanceAll for this number of ticks without poses. The replica must have a
  /// movement and no layers, and AdvanceAll must have been called since the last record.
  void SkipTicks(std::uint64_t ticks, double length_s);

  /// True if the replica has received a state, and no error has occurred since then.
  [[nodiscard]] bool is_known() const { return is_known_; }
  /// The displayed pose in world space, after AdvanceAll for a tick with poses. Undefined unless
  /// is_known().
  [[nodiscard]] ConstPoseSpan pose() const {
    return is_moving_ && !has_layers() ? AheadPose() : body_.DisplayedPose();
  }
  /// AvatarSimulation::idle() of the avatar: it stands and has no queued requests.
  [[nodiscard]] bool idle() const { return is_idle_; }
  /// The movement that determines the displayed pose: the current movement or, while standing, the
  /// idle motion. Null if the avatar stands without idle motion.
  [[nodiscard]] const Movement* movement() const { return is_moving_ ? &body_.movement : nullptr; }
  /// A number that changes whenever a record contains a whole state, or starts or ends a movement.
  /// While it stays the same, the movement does not change.
  [[nodiscard]] std::uint32_t movement_number() const { return movement_number_; }
  /// Time within the previous movement at which that movement ended or was interrupted. Negative if
  /// the current movement did not directly follow another one.
  [[nodiscard]] double previous_end_s() const { return previous_end_s_; }
  /// Time within movement() at the last tick. Undefined if movement() is null.
  [[nodiscard]] double movement_time_s() const { return movement_time_s_; }
  /// True if layers change the displayed pose.
  [[nodiscard]] bool has_layers() const { return may_have_layers_ && body_.has_layers; }
  /// Prefetches what pose() returns.
  void PrefetchPose() const;
  [[nodiscard]] const MotionLibrary& library() const { return *body_.library; }

 private:
  class Reader;
  friend class ReplicaEvaluator;
  /// Number of poses of a movement that are evaluated at once.
  static constexpr std::size_t kPosesAhead = 8;

  void ReadChange(unsigned flags, Reader& reader, FootPlanScratch& scratch);
  void ReadState(unsigned flags, Reader& reader);
  /// Returns true if the pose of the current tick has already been evaluated.
  [[nodiscard]] bool HasAheadPose() const {
    return ahead_tick_ % ahead_ticks_apart_ == 0 && ahead_tick_ / ahead_ticks_apart_ < ahead_count_;
  }
  [[nodiscard]] ConstPoseSpan AheadPose() const {
    const std::size_t i = ahead_tick_ / ahead_ticks_apart_;
    const std::size_t joints = ahead_rotations_.size() / kPosesAhead;
    return {ahead_roots_m_[i], std::span(ahead_rotations_).subspan(i * joints, joints)};
  }

  // The members that are read in every tick come first, in few cache lines.
  double movement_time_s_ = 0.0;
  std::uint32_t movement_number_ = 0;
  bool is_known_ = false;
  bool is_moving_ = false;
  bool is_idle_ = false;
  // True if the last record set the movement time (or the layers) of the next tick. The next
  // AdvanceAll then must not advance them.
  bool is_time_set_ = false;
  bool are_layers_set_ = false;
  bool may_have_layers_ = false;  // False: neither the body nor its displayed pose has layers.
  // Number of poses that have been evaluated ahead, without layers, and the number of ticks from
  // one of them to the next.
  std::uint32_t ahead_count_ = 0;
  std::uint32_t ahead_ticks_apart_ = 1;
  std::uint32_t ahead_tick_ = 0;  // Number of ticks since the first of the poses evaluated ahead.
  std::vector<Quat> ahead_rotations_;  // [kPosesAhead][joint]
  std::array<Vec3, kPosesAhead> ahead_roots_m_ = {};
  double previous_end_s_ = -1.0;
  AvatarBody body_;
};

}  // namespace stridewire
