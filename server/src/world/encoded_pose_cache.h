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

/// What poses of a library are evaluated and encoded in. One serves all worlds of a thread.
struct PoseScratch {
  explicit PoseScratch(std::shared_ptr<const MotionLibrary> of_library);

  std::shared_ptr<const MotionLibrary> library;
  SoaPoseEvaluator evaluator;  ///< Of EncodedPoseCache::kMost
  PlanScratch plan;
  EvaluationBatcher queue;
  SoaPose taken;
  Pose pose;
  static constexpr std::size_t kModes = 4;
  std::array<protocol::CompactCodec::Block, kModes> blocks;
};

/// Encodes compact poses for several ticks at once. What an avatar shows is settled when its
/// movement begins, so what it is made of is brought into the cache, blended and unpacked once in
/// kMost ticks; in each tick its turn is other avatars'. Who is sent elsewhere meanwhile is
/// evaluated anew, and less far ahead the next time. One a world and shard; not thread-safe.
///
///   ahead.Begin(step, step_s, avatars);
///   for each avatar: ahead.Ask(place, avatar)
///   ahead.Finish();
///   for each avatar: … ahead.Of(place, mode) …
///
/// What is kept of a tick lies together, in the order of places:
///
///   tick 16   [ avatar 0: pose in each mode ][ avatar 1 ] …   one plane for each of kMost ticks,
///   tick 17   [ avatar 0 ][ avatar 1 ] …                      used again and again
///   …
///   standing  [ avatar 0 ][ avatar 1 ] …                      of who stands, for all ticks
///
/// It is more than caches hold: each avatar has cache lines of its own, which are written whole and
/// past the caches, and are asked for before they are read.
class EncodedPoseCache {
 public:
  static constexpr std::size_t kMost = 16;
  /// In how many ticks each of so many avatars has its turn. Of few, those whose turn it is would
  /// not fill the lanes.
  [[nodiscard]] static constexpr std::size_t TurnsOf(std::size_t shown) {
    return shown < 2048 || shown > kMany ? kMost / 2 : kMost;
  }
  /// Of more avatars there are planes of kMost / 2 ticks only, for their memory.
  static constexpr std::size_t kMany = 32'768;

  /// Where an avatar's poses are kept. Given back when the avatar goes, before EncodedPoseCache
  /// does.
  class Place {
   public:
    Place() = default;
    ~Place() {
      if (of_ != nullptr) of_->free_.push_back(index_);
    }
    Place(Place&& other) noexcept : of_(std::exchange(other.of_, nullptr)), index_(other.index_) {}
    Place& operator=(Place&& other) noexcept {
      std::swap(of_, other.of_);
      std::swap(index_, other.index_);
      return *this;
    }

   private:
    friend class EncodedPoseCache;
    EncodedPoseCache* of_ = nullptr;
    std::uint32_t index_ = 0;
  };

  /// `codecs` may be null: of a world without compact poses only roots are kept, as without modes.
  /// They outlive it.
  EncodedPoseCache(std::shared_ptr<PoseScratch> scratch, const protocol::CompactCodecs* codecs);
  EncodedPoseCache(const EncodedPoseCache&) = delete;
  EncodedPoseCache& operator=(const EncodedPoseCache&) = delete;

  /// In which modes poses are told, and every how many ticks. What was kept for others is nothing
  /// any more.
  void SetModes(std::span<const protocol::PoseMode> compact_modes, int ticks_apart);

  /// The step that poses are asked for from now on, how long steps are, and how many avatars are
  /// shown in this one: those that have their poses among them.
  void Begin(std::uint64_t step, double step_s, std::size_t shown);

  /// Asks for an avatar's pose of this step, which is there after Finish; the avatar stays as it is
  /// until then.
  void Ask(Place& place, AvatarSimulation& avatar);

  // What Ask does, for who has no avatar.
  /// Poses of this step are there already.
  [[nodiscard]] bool Has(const Place& place, std::uint64_t revision) const {
    if (place.of_ == nullptr) return false;
    const Kept& kept = kept_[place.index_];
    return kept.revision == static_cast<std::uint32_t>(revision) && kept.layout == layout_ &&
           (kept.stays || PoseOf(kept) < kept.count);
  }
  /// Those of this step and of some to come are wanted of a movement at `time_s`, which stays where
  /// it is until Finish.
  void Want(Place& place, std::uint64_t revision, const Movement& movement, double time_s);
  /// The pose of this step; if it `stays`, of all steps to come. The pose itself is not looked at
  /// any more.
  void Take(Place& place, std::uint64_t revision, ConstPoseSpan pose, bool stays);

  /// Now they are there.
  void Finish();

  struct Encoded {
    std::span<const std::byte> bytes;  ///< Empty: the pose can not be told
    bool is_wide = false;              ///< As in kQuantised (kPoseWide)
  };
  /// This step's, of who has it. `mode` is one of SetModes.
  [[nodiscard]] Encoded Of(const Place& place, protocol::PoseMode mode) const;
  /// As it is told; of a pose that can not be, beyond where any can.
  [[nodiscard]] Vec3 RootOf(const Place& place) const;

  [[nodiscard]] SoaPoseEvaluator& evaluator() { return scratch_->evaluator; }
  [[nodiscard]] PlanScratch& plan_scratch() { return scratch_->plan; }

 private:
  static constexpr std::size_t kLanes = SoaPose::kLanes;
  static constexpr std::size_t kStanding = kMost;  // plane
  // Places that lie together have their turns together.
  static constexpr std::uint32_t kPlacesOfATurn = 8;
  struct alignas(kCacheLineBytes) Line {
    std::byte of[kCacheLineBytes];
  };
  struct Mode {
    protocol::PoseMode mode;
    const protocol::CompactCodec* codec;
    std::size_t at;      // in the bytes of a pose
    std::size_t pieces;  // CompactCodec::Block::StreamBytes
  };
  // What every tick asks of the poses of one place.
  struct Kept {
    std::uint64_t first_step = 0;  // of the world
    std::uint32_t revision = 0;    // they follow from, the low bits
    std::uint16_t layout = 0;      // 0: nothing is kept
    std::uint8_t count = 0;
    std::uint8_t first_plane : 4 = 0;
    std::uint8_t stays : 1 = 0;
    std::uint8_t is_any_other : 1 = 0;  // than the mode's own bytes: see Others
    std::uint8_t cuts : 2 = 0;  // kMost >> cuts are made at once: more whenever some were in vain
  };
  static_assert(sizeof(Kept) == 16 && kMost <= 16);
  // Of a place some of whose poses are wide or can not be told.
  struct Others {
    std::array<std::uint8_t, kMost> flags{};  // [pose]: bit m: wide in mode m; m + 4: there is none
    std::vector<std::byte> wide;              // by pose and mode
  };
  struct Wanted {
    std::uint32_t place;
    int count;
    SampleRun run;
    bool is_its_turn;
  };

  // Which of those kept is of this step; more than there are if none.
  [[nodiscard]] std::size_t PoseOf(const Kept& kept) const {
    if (kept.stays) return 0;
    const std::uint64_t steps = step_ - kept.first_step;
    const auto apart = static_cast<std::uint64_t>(ticks_apart_);
    return apart == 1 ? steps : steps % apart == 0 ? steps / apart : kMost;
  }
  [[nodiscard]] std::size_t PlaneOf(const Kept& kept, std::size_t pose) const {
    return kept.stays ? kStanding : (kept.first_plane + pose) % ring_;
  }
  [[nodiscard]] const std::byte* BytesIn(std::size_t plane, std::size_t place) const {
    return reinterpret_cast<const std::byte*>(planes_[plane].data()) + place * pose_bytes_;
  }
  [[nodiscard]] const std::byte* BytesOf(std::uint32_t place, std::size_t pose) const {
    return BytesIn(PlaneOf(kept_[place], pose), place);
  }
  [[nodiscard]] std::byte* BytesOf(std::uint32_t place, std::size_t pose) {
    return const_cast<std::byte*>(std::as_const(*this).BytesOf(place, pose));
  }
  // Nothing of what was kept is any more.
  void Forget();
  // Room for all places in the planes that are used, no more.
  void SizePlanes();
  void MakePlace(Place& place);
  [[nodiscard]] std::uint8_t CutsAfter(const Kept& kept, std::uint64_t revision) const;
  void Start(std::uint32_t place, std::uint64_t revision, std::size_t count, bool stays);
  void KeepTaken();
  // Encodes poses side by side and keeps them; of kNobody nothing is kept.
  static constexpr std::uint32_t kNobody = ~0u;
  void Keep(const SoaPose& lanes, std::span<const std::uint32_t> places, std::size_t pose);
  void KeepWide(const SoaPose& lanes, std::size_t lane, std::uint32_t place, std::size_t pose,
                std::size_t mode);
  [[nodiscard]] Encoded OtherOf(std::uint32_t place, std::size_t pose, std::size_t mode) const;

  std::shared_ptr<PoseScratch> scratch_;
  const protocol::CompactCodecs* codecs_;
  std::vector<Mode> modes_;
  std::size_t pose_bytes_;  // of a pose in all modes: whole lines, or a root
  std::size_t wide_bytes_;
  int ticks_apart_ = 1;
  std::size_t ring_ = kMost;  // planes that ticks take turns in
  std::uint16_t layout_ = 1;
  std::uint64_t step_ = 0;
  std::uint8_t plane_ = 0;  // of this step
  double step_s_ = 0.0;
  std::size_t shown_ = 0;

  std::vector<Kept> kept_;                            // [place]
  std::array<std::vector<Line>, kMost + 1> planes_;   // [place]: pose_bytes_ each
  std::unordered_map<std::uint32_t, Others> others_;  // by place
  std::vector<std::uint32_t> free_;                   // places of nobody

  std::vector<Wanted> wanted_;
  std::array<std::uint32_t, kLanes> taken_for_{};
  std::size_t taken_count_ = 0;
};

}  // namespace stridewire::server
