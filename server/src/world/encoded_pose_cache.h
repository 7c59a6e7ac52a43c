#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/prefetch.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/pose/evaluation_batcher.h"
#include "stridewire/protocol/compact_codecs.h"

namespace stridewire::server {

/// Scratch memory for evaluating and encoding the poses of one library. All caches of a thread that
/// use this library share it.
struct PoseScratch {
  explicit PoseScratch(std::shared_ptr<const MotionLibrary> of_library);

  std::shared_ptr<const MotionLibrary> library;
  SoaPoseEvaluator evaluator;  ///< Evaluates up to EncodedPoseCache::kMaxTicksAhead poses per run.
  PlanScratch plan;            ///< Scratch memory for starting movements.
  EvaluationBatcher batcher;
  SoaPose stored;  ///< Poses from EncodedPoseCache::Store that are not encoded yet.
  Pose pose;
  static constexpr std::size_t kMaxModes = 4;
  std::array<protocol::CompactCodec::Block, kMaxModes> blocks;
};

/// Evaluates and encodes the poses of a world's avatars for several ticks at once, which is faster
/// than one tick at a time. This is possible because a movement is fixed when it starts. One cache
/// per world and shard; not thread-safe.
///
///   cache.BeginStep(step, step_s, avatar_count);
///   for each avatar: cache.Request(slot, avatar);
///   cache.FinishStep();
///   for each avatar: cache.Find(slot, mode);
///
/// Each avatar owns a slot. The states of a slot:
///
///                 Schedule                FinishStep
///       +-------> scheduled --------------------------> timed <-------+
///       |             ^                                 |   |         |
///     empty           +------------- Schedule ----------+   | Store   | Store
///       |             |                                     | (const) | (one step)
///       |             | Schedule                            v         |
///       +--------> constant <-------------------------------+         |
///   Store (const)     |                                               |
///                     +-----------------------------------------------+
///
/// Release (the avatar was removed) and Forget (SetModes, or the crowd became large) lead from
/// empty, timed and constant to empty. Neither may happen while a slot is scheduled. Store (one
/// step) also leads from empty to timed. It is called in every step of an avatar with layers.
///
///   empty       The slot contains no pose.
///   scheduled   FinishStep will evaluate the poses of a movement. Until then, the movement must
///               exist and must not change.
///   timed       The slot contains `count` poses, for steps first_step, first_step + steps_apart...
///               If the avatar's revision has changed, or no pose is left for the current step,
///               Contains returns false and the slot must be scheduled or stored again.
///   constant    The slot contains one pose for all steps, because the avatar stands still.
///
/// Backoff: if an avatar is interrupted before all its poses were used, the maximum number of poses
/// that FinishStep evaluates for it is halved (down to 1/8). The maximum doubles again each time
/// all poses were used.
///
/// Phases: FinishStep spreads the evaluation over several steps. Slots form groups of 8, and the
/// groups take turns. A slot that is scheduled outside the turn of its group gets only the poses
/// until that turn, or a single pose if a whole crowd is scheduled at once.
///
/// Memory layout: the poses of one step are stored together, in the order of slots, in one plane.
/// The planes form a ring.
///
///   plane 0   [ slot 0: pose in each mode ][ slot 1 ] ...    steps 0, 16, 32, ...
///   plane 1   [ slot 0 ][ slot 1 ] ...                       steps 1, 17, 33, ...
///   ...
///   constant  [ slot 0 ][ slot 1 ] ...                       constant poses
///
/// The planes are larger than the processor caches. Poses are therefore aligned to cache lines,
/// written with non-temporal stores, and prefetched before they are read.
class EncodedPoseCache {
 public:
  static constexpr std::size_t kMaxTicksAhead = 16;
  /// If there are more avatars than this, the ring has only kMaxTicksAhead / 2 planes, to save
  /// memory.
  static constexpr std::size_t kLargeCrowd = 32'768;
  /// Returns the number of phases for `avatar_count` avatars: each group has its turn once in this
  /// many steps. A small crowd has fewer phases, because otherwise the avatars of one phase would
  /// not fill the SIMD lanes. A large crowd has one phase per plane of its smaller ring.
  [[nodiscard]] static constexpr std::size_t PhasesOf(std::size_t avatar_count) {
    return avatar_count < 2048 || avatar_count > kLargeCrowd ? kMaxTicksAhead / 2 : kMaxTicksAhead;
  }

  /// Owns the poses of one avatar in the cache. The destructor releases them, so a slot must be
  /// destroyed before the cache.
  class Slot {
   public:
    Slot() = default;
    ~Slot() {
      if (cache_ != nullptr) cache_->Release(index_);
    }
    Slot(Slot&& other) noexcept
        : cache_(std::exchange(other.cache_, nullptr)), index_(other.index_) {}
    Slot& operator=(Slot&& other) noexcept {
      std::swap(cache_, other.cache_);
      std::swap(index_, other.index_);
      return *this;
    }
    /// Returns the number of the slot, with which Find reads its poses. It is undefined before the
    /// first Schedule or Store, and does not change afterwards.
    [[nodiscard]] std::uint32_t number() const { return index_; }

   private:
    friend class EncodedPoseCache;
    // The cache that owns the slot; null until the first Schedule or Store.
    EncodedPoseCache* cache_ = nullptr;
    std::uint32_t index_ = 0;
  };

  /// Borrows `codecs`. If it is null, or if SetModes sets no mode, the cache stores only the
  /// positions of roots.
  EncodedPoseCache(std::shared_ptr<PoseScratch> scratch, const protocol::CompactCodecs* codecs);
  EncodedPoseCache(const EncodedPoseCache&) = delete;
  EncodedPoseCache& operator=(const EncodedPoseCache&) = delete;

  /// Sets the compact modes in which poses are encoded. Poses are needed every `steps_apart` steps.
  /// If either changes, all slots become empty. Do not call it between BeginStep and FinishStep.
  void SetModes(std::span<const protocol::PoseMode> compact_modes, int steps_apart);

  /// Starts a step, to which the following calls apply. `step_s` is the length of a step,
  /// `avatar_count` the number of avatars whose poses are used in this step.
  void BeginStep(std::uint64_t step, double step_s, std::size_t avatar_count);

  /// Makes sure that FinishStep provides the avatar's pose of this step. The avatar must not change
  /// until then.
  void Request(Slot& slot, AvatarSimulation& avatar);

  // The following three functions are the parts of Request.

  /// True if the slot contains the pose of this step.
  [[nodiscard]] bool Contains(const Slot& slot, std::uint64_t revision) const {
    if (slot.cache_ == nullptr) return false;
    const SlotState& state = slots_[slot.index_];
    if (state.revision != static_cast<std::uint32_t>(revision)) return false;
    return state.kind == SlotState::kConstant ||
           (state.kind == SlotState::kTimed && PoseIndex(state) < state.count);
  }
  /// Schedules the evaluation of a movement for this step and possibly some later steps. `time_s`
  /// is the time of the movement at this step. The movement must exist and must not change until
  /// FinishStep.
  void Schedule(Slot& slot, std::uint64_t revision, const Movement& movement, double time_s);
  /// Encodes a copy of `pose` and stores it for this step or, if `is_constant`, for all steps.
  void Store(Slot& slot, std::uint64_t revision, ConstPoseSpan pose, bool is_constant);

  /// Evaluates and encodes everything that was scheduled.
  void FinishStep();

  struct Encoded {
    /// Bytes of the pose. Empty if it cannot be encoded in any format.
    std::span<const std::byte> bytes;
    /// True if the pose is in the format of kQuantised (kPoseUncompressed).
    bool is_uncompressed = false;
  };
  /// Returns the pose of this step, which the slot with the number `slot` must contain. `mode` must
  /// be one of SetModes.
  [[nodiscard]] Encoded Find(std::uint32_t slot, protocol::PoseMode mode) const;
  /// Returns the root position of this step with the precision of the encoded pose. If the pose
  /// cannot be encoded, all coordinates are kMaxRootM, so that the avatar is far from all regions.
  [[nodiscard]] Vec3 FindRoot(std::uint32_t slot) const;

  [[nodiscard]] SoaPoseEvaluator& evaluator() { return scratch_->evaluator; }
  [[nodiscard]] PlanScratch& plan_scratch() { return scratch_->plan; }

 private:
  static constexpr std::size_t kLanes = SoaPose::kLanes;
  static constexpr std::size_t kConstantPlane = kMaxTicksAhead;
  // Slots of one group, which are evaluated in the same phase.
  static constexpr std::uint32_t kSlotsPerGroup = 8;
  static constexpr unsigned kMaxBackoff = 3;
  static constexpr std::uint32_t kNoSlot = ~0u;
  struct alignas(kCacheLineBytes) Line {
    std::byte bytes[kCacheLineBytes];
  };
  struct Mode {
    protocol::PoseMode mode;
    const protocol::CompactCodec* codec;
    std::size_t offset;  // Position of the mode's bytes within the bytes of a slot.
    std::size_t pieces;  // Pieces of 16 bytes that CompactCodec::Block::StreamBytes writes.
  };
  // State of one slot; read in every tick.
  struct SlotState {
    enum Kind : std::uint8_t { kEmpty, kScheduled, kTimed, kConstant };
    std::uint64_t first_step = 0;  // In state kTimed: step of the first pose.
    std::uint32_t revision = 0;    // Low bits of the avatar's revision.
    std::uint8_t count = 0;        // Number of poses: 0 if empty or scheduled, 1 if constant.
    std::uint8_t first_plane = 0;
    Kind kind = kEmpty;
    std::uint8_t has_overflow : 1 = 0;  // see Overflow
    // Exponent of the backoff: at most ring_size_ >> backoff poses are evaluated.
    std::uint8_t backoff : 2 = 0;
  };
  static_assert(sizeof(SlotState) == 16);
  // Poses of a slot that a mode cannot represent. They are stored uncompressed, if possible.
  struct Overflow {
    // Flags by pose. Bit m: uncompressed in mode m; bit m + kMaxModes: not encodable in mode m.
    std::array<std::uint8_t, kMaxTicksAhead> flags{};
    std::vector<std::byte> bytes;  // Uncompressed poses, ordered by pose and mode.
  };
  struct Scheduled {
    std::uint32_t slot;
    int count;
    SampleRun run;
    bool is_in_phase;
  };

  // Returns the index of the pose of the current step, or at least `count` if there is none.
  [[nodiscard]] std::size_t PoseIndex(const SlotState& state) const {
    if (state.kind == SlotState::kConstant) return 0;
    const std::uint64_t steps = step_ - state.first_step;
    const auto apart = static_cast<std::uint64_t>(steps_apart_);
    return apart == 1 ? steps : steps % apart == 0 ? steps / apart : kMaxTicksAhead;
  }
  [[nodiscard]] std::size_t PlaneOf(const SlotState& state, std::size_t pose) const {
    return state.kind == SlotState::kConstant ? kConstantPlane
                                              : (state.first_plane + pose) % ring_size_;
  }
  [[nodiscard]] const std::byte* BytesIn(std::size_t plane, std::size_t slot) const {
    return reinterpret_cast<const std::byte*>(planes_[plane].data()) + slot * pose_bytes_;
  }
  [[nodiscard]] const std::byte* BytesOf(std::uint32_t slot, std::size_t pose) const {
    return BytesIn(PlaneOf(slots_[slot], pose), slot);
  }
  [[nodiscard]] std::byte* BytesOf(std::uint32_t slot, std::size_t pose) {
    return const_cast<std::byte*>(std::as_const(*this).BytesOf(slot, pose));
  }
  // Makes all slots empty.
  void Forget();
  // Allocates room for all slots in the planes that are in use.
  void ResizePlanes();
  void Allocate(Slot& slot);
  void Release(std::uint32_t slot);
  [[nodiscard]] std::uint8_t NextBackoff(const SlotState& state, std::uint64_t revision) const;
  // Changes the state of a slot to timed or constant.
  void Fill(std::uint32_t slot, std::uint64_t revision, std::size_t count, SlotState::Kind kind);
  void EncodeStored();
  // Encodes the poses in `lanes` and writes them as pose number `pose` of `slots`. Lanes whose slot
  // is kNoSlot are skipped.
  void Encode(const SoaPose& lanes, std::span<const std::uint32_t> slots, std::size_t pose);
  void EncodeOverflow(ConstPoseSpan pose, std::uint32_t slot, std::size_t pose_index,
                      std::size_t mode);
  [[nodiscard]] Encoded FindOverflow(std::uint32_t slot, std::size_t pose, std::size_t mode) const;

  std::shared_ptr<PoseScratch> scratch_;
  const protocol::CompactCodecs* codecs_;
  std::vector<Mode> modes_;
  // Number of bytes per pose in a plane: the encodings in all modes, padded to whole cache lines.
  // If there are no modes, only the root position is stored.
  std::size_t pose_bytes_;
  std::size_t uncompressed_bytes_;
  int steps_apart_ = 1;
  std::size_t ring_size_ = kMaxTicksAhead;  // Number of planes in use, except kConstantPlane.
  std::uint64_t step_ = 0;
  std::uint8_t plane_ = 0;  // Plane of the current step.
  double step_s_ = 0.0;
  std::size_t avatar_count_ = 0;

  std::vector<SlotState> slots_;
  // The planes; each has pose_bytes_ per slot.
  std::array<std::vector<Line>, kMaxTicksAhead + 1> planes_;
  std::unordered_map<std::uint32_t, Overflow> overflow_;  // by slot
  std::vector<std::uint32_t> free_;                       // Slots without an avatar.

  std::vector<Scheduled> scheduled_;
  std::array<std::uint32_t, kLanes> stored_slots_{};  // Slot of each lane of PoseScratch::stored.
  std::size_t stored_count_ = 0;
};

}  // namespace stridewire::server
