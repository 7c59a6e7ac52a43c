#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "pose_history.h"
#include "pose_recording.h"
#include "replica_set.h"
#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::client {

/// Memory of all pose histories of a client, in bytes.
struct PoseBudget {
  std::size_t limit_bytes = 0;
  std::size_t used_bytes = 0;
};

/// Counts of displayed poses.
struct DisplayCounts {
  std::uint64_t poses = 0;
  std::uint64_t extrapolated = 0;
  /// Poses that were displayed for times after the newest received pose without extrapolation,
  /// because the extrapolated motion had stopped or because there was no motion to extrapolate.
  std::uint64_t held = 0;

  void Add(const PoseHistory::Sampled& sampled, bool is_after_newest) {
    ++poses;
    if (sampled.extrapolated) ++extrapolated;
    if (is_after_newest && !sampled.extrapolated) ++held;
  }
};

/// The skeleton of a joined world and the received poses of its avatars.
class WorldView : public PoseSink {
 public:
  /// Poses of an avatar that is gone can be sampled for this time, in seconds of server time.
  static constexpr double kKeepGoneS = 2.0;
  /// If an avatar has left the region, the view ignores its older poses for at least this many
  /// ticks.
  static constexpr std::uint64_t kKeepLeftTicks = 600;
  /// Maximum number of pairs of a shard and a mode. A batch of any further pair is an error.
  static constexpr std::size_t kMaxShards = 1024;

  struct Counts {
    std::uint64_t batches = 0;
    std::uint64_t poses = 0;
    /// Poses that were dropped for lack of memory or because they were not newer than the last one.
    std::uint64_t refused = 0;
    std::uint64_t missing = 0;  ///< Estimated number of missing batches, from gaps in the ticks.
  };

  /// When poses of movements are evaluated.
  enum class Evaluation : std::uint8_t {
    kEveryTick,    ///< In every tick. For applications that read the poses of ticks.
    kWhenSampled,  ///< When they are read. For applications that sample all avatars per frame.
  };

  /// `recording` is the empty recording of the view, with its limits. By default, nothing is
  /// recorded.
  WorldView(std::size_t pose_history, PoseBudget& budget,
            PoseRecording recording = PoseRecording(0.0, 0),
            Evaluation evaluation = Evaluation::kEveryTick)
      : pose_history_(pose_history),
        budget_(budget),
        evaluation_(evaluation),
        recording_(std::move(recording)) {}
  ~WorldView() override { Clear(); }
  WorldView(const WorldView&) = delete;
  WorldView& operator=(const WorldView&) = delete;

  /// Sets the description of the world. If the skeleton has changed, all poses are removed.
  void SetInfo(const protocol::WorldInfo& info);
  [[nodiscard]] bool has_info() const { return has_info_; }
  [[nodiscard]] const protocol::SkeletonInfo& skeleton() const { return skeleton_; }
  [[nodiscard]] const std::string& library_hash() const { return library_hash_; }
  [[nodiscard]] const std::vector<std::string>& layers() const { return layers_; }

  /// Returns the codecs for the compact poses of a world; null if the server sends none.
  [[nodiscard]] static std::shared_ptr<const protocol::CompactCodecs> MakeCodecs(
      const protocol::WorldInfo& info);

  /// Removes the description and all poses.
  void Clear();
  void ClearPoses();

  /// Marks the next pose of every avatar as a discontinuity. Call it after a resume and after a new
  /// subscription. The server cannot flag these discontinuities, because clients share batches.
  void Break() {
    ++epoch_;
    EndContinuingAll();
  }

  /// Stores only poses of these avatars. nullopt: of all avatars.
  void SetFilter(std::optional<std::set<protocol::AvatarId>> filter);

  /// Stores the poses of a batch. `every_n_ticks` is the requested interval, from which missing
  /// batches are counted; 0: unknown. On error, the poses before the invalid one are stored. Fails
  /// with the errors of PoseBatchReader::Decode, with kShapeMismatch for another number of joints,
  /// with kLimitExceeded for too many shards, and with kMalformed if the ticks of a shard decrease.
  Status Apply(const protocol::PoseBatch& batch, std::uint64_t every_n_ticks, Counts& counts);

  /// Applies movement records to `replicas`. Evaluates, stores and records the poses of ticks that
  /// are multiples of `every_n_ticks`. Fails with the errors of ReplicaSet::Apply, and with
  /// kShapeMismatch.
  Status Apply(const protocol::Movements& movements, ReplicaSet& replicas,
               std::uint64_t every_n_ticks, Counts& counts);

  /// Marks an avatar as gone.
  void Remove(protocol::AvatarId avatar);
  /// Marks an avatar as gone because it left the observed region at `tick`. Its poses of earlier
  /// ticks that arrive later are ignored.
  void Leave(protocol::AvatarId avatar, std::uint64_t tick);

  /// Assigns new segments to all stored poses. Call it after the displayed time has jumped.
  void RenumberSegments();

  /// Returns the poses of an avatar, or null if it is unknown.
  [[nodiscard]] PoseHistory* Find(protocol::AvatarId avatar);
  [[nodiscard]] bool IsGone(protocol::AvatarId avatar) const;

  /// Returns the avatars that are not gone, in ascending order.
  [[nodiscard]] std::vector<protocol::AvatarId> Avatars() const;
  /// Changes whenever the result of Avatars changes.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }

  /// Returns the recording of the last seconds. It contains the received batches. In movement mode,
  /// it contains the movements instead, and encoded poses of avatars without a movement or with
  /// layers. Clear also clears the recording.
  [[nodiscard]] PoseRecording& recording() { return recording_; }

  /// Samples all avatars at a server time, for display, and counts the poses.
  void SampleAll(double time_s, CrowdPose& out, DisplayCounts& displayed);

  /// Returns true if the filter admits an avatar.
  [[nodiscard]] bool Admits(protocol::AvatarId avatar) const {
    return !filter_ || filter_->contains(avatar);
  }

  /// Server time of the newest message with poses; negative infinity if there was none.
  [[nodiscard]] double newest_time_s() const { return newest_time_s_; }

 private:
  /// A ring buffer of the last ticks of a shard in which poses were evaluated. These ticks are
  /// numbered from 0 in order of arrival.
  struct ShardTicks {
    struct Tick {
      std::uint64_t tick = 0;
      double time_s = 0.0;
      std::uint64_t step = 0;  ///< Movements::step
    };
    std::array<Tick, 128> ring;
    std::uint64_t count = 0;
    [[nodiscard]] const Tick& at(std::uint64_t i) const { return ring[i % ring.size()]; }
    /// Returns the number of the oldest tick.
    [[nodiscard]] std::uint64_t oldest() const {
      return count - std::min<std::uint64_t>(count, ring.size());
    }

    // Scratch memory of SampleAll: the sampled time is between tick number `sampled` and the next
    // one, and `share` is the fraction of this interval that has passed. `is_sampled` is false if
    // the time is before the oldest or after the newest tick.
    std::uint64_t sampled = 0;
    double share = 0.0;
    bool is_sampled = false;
    void FindSample(double time_s);
  };
  /// A point of a movement.
  struct MovementPoint {
    std::uint64_t tick = 0;  ///< Number of the tick in ShardTicks.
    std::uint64_t step = 0;  ///< Movements::step of the tick.
    double time_s = 0.0;     ///< Time of the movement at the tick.
  };
  /// A movement that continues in all ticks of its shard until the next record of the avatar. The
  /// poses of its ticks after `stored` are not in the history yet. SampleAll evaluates the movement
  /// without reading the history, and ticks do not access the track. This saves most cache misses.
  struct Continued {
    const PlayedMovement* movement = nullptr;  ///< Null: the history contains all poses.
    const ShardTicks* ticks = nullptr;
    MovementPoint sampled;  ///< Tick from which SampleAll counts forward to the sampled tick.
    MovementPoint stored;   ///< Newest tick in the history.
    // Copies of data of the movement: the original is usually not in the processor's cache.
    EvaluationBatcher::Similarity similarity;
    std::uint32_t number = 0;  ///< PlayedMovement::number
    bool standing = false;
    bool is_displayed = false;  ///< True if SampleAll has evaluated the movement.
  };
  struct Track {
    // The members that are read in every tick come first.
    protocol::AvatarId avatar = 0;
    std::uint16_t shard = 0;
    protocol::PoseMode mode = protocol::PoseMode::kFull;
    bool gone = false;
    std::uint32_t segment = 0;  ///< Segment of the newest pose.
    Continued continued;
    std::uint64_t seen_tick = 0;
    std::uint64_t epoch = 0;
    PoseHistory history;
    MovementRecording::Cursor recorded;
    std::shared_ptr<const PlayedMovement> movement;  ///< A copy of the current movement, or null.
  };
  struct Shard {
    std::uint64_t tick = 0;  ///< Tick of the last batch.
    std::uint32_t parts_seen = 0;
    std::uint64_t epoch = 0;
    protocol::PoseMode mode = protocol::PoseMode::kFull;
  };
  using Lane = std::pair<std::uint16_t, protocol::PoseMode>;  // shard, mode

  bool OnPose(protocol::AvatarId avatar, std::uint16_t shard, const PoseStamp& stamp,
              const AvatarReplica& replica) override;
  void OnContinued(protocol::AvatarId avatar) override;
  [[nodiscard]] std::vector<protocol::AvatarId> TakeEnded() override {
    return std::exchange(ended_, {});
  }
  void Prefetch(protocol::AvatarId avatar) override;
  void OnGone(protocol::AvatarId avatar) override { Remove(avatar); }
  [[nodiscard]] bool Wants(protocol::AvatarId avatar) const override { return Admits(avatar); }
  [[nodiscard]] std::uint64_t EveryNTicks() const override { return replica_every_n_ticks_; }
  [[nodiscard]] bool EvaluatesMovements() const override {
    return evaluation_ == Evaluation::kWhenSampled;
  }
  /// Returns the first track whose avatar is not below `avatar`.
  [[nodiscard]] std::vector<Track>::iterator LowerBound(protocol::AvatarId avatar);
  [[nodiscard]] const Track* FindTrack(protocol::AvatarId avatar) const;
  /// Finds or creates the track of an avatar. Returns null if there is no memory for it. Calls with
  /// ascending ids are fast, because each search begins after the last track that was found.
  Track* FindOrAddTrack(protocol::AvatarId avatar);
  /// Returns the index of the avatar's track, or tracks_.size() if it is not among the next few
  /// tracks from `index` on.
  [[nodiscard]] std::size_t FindTrackAfter(std::size_t index, protocol::AvatarId avatar) const;
  /// Sets the segment of `stamp`, calls `push(stamp)` to add a pose to the history, and updates the
  /// track and `counts`.
  template <typename PushPose>
  void Push(Track& track, const Lane& lane, PoseStamp stamp, Counts& counts, const PushPose& push);
  /// Returns true if an avatar has a movement and no layers.
  [[nodiscard]] static bool HasMovementOnly(const AvatarReplica& replica);
  void PushEvaluated(Track& track, std::uint16_t shard, const PoseStamp& stamp,
                     const AvatarReplica& replica);
  void Record(Track& track, const PoseStamp& stamp, const AvatarReplica& replica);
  /// Adds the tick of the current message to those of its shard.
  void AddTick();
  /// Returns true if a pose belongs to the movement that the track continues, so that it need not
  /// be stored.
  [[nodiscard]] bool IsContinued(const Track& track, const PoseStamp& stamp,
                                 const AvatarReplica& replica) const;
  /// Begins to continue the movement of the newest pose, unless the display has extrapolated beyond
  /// this pose, or a correction still fades.
  void BeginContinuing(Track& track);
  /// Moves a point of a movement to a later tick. Sums the time tick by tick, as replicas do.
  void MoveTo(std::uint64_t tick, const ShardTicks& ticks, MovementPoint& point) const;
  /// Returns the time of the movement that SampleAll evaluates for a track, if any.
  [[nodiscard]] std::optional<double> SampledTime(Continued& continued) const;
  /// Prepares the history of a track for a time at which SampleAll does not evaluate the movement
  /// that continues.
  void PrepareHistory(Track& track, double time_s);
  /// Adds the poses of the movement that continues to the history, up to the tick before `end`.
  void Flush(Track& track, std::uint64_t end);
  void Flush(Track& track) {
    if (track.continued.movement != nullptr) Flush(track, track.continued.ticks->count);
  }
  /// Adds all poses to the history, which then determines the motion. The next tick calls OnPose.
  void EndContinuing(Track& track);
  void EndContinuingAll();
  /// Adds the ticks of continued movements to histories and recordings, before ShardTicks drops
  /// these ticks. Each call visits a part of the tracks.
  void UpdateContinued(const protocol::Movements& movements);
  /// Copies the movement of an avatar unless the track has it already.
  static void KeepMovement(Track& track, const AvatarReplica& replica);

  /// Adds a batch to the recording after a Movements message: the poses of the avatars in
  /// `evaluated_`, and the avatars in `moving_`, whose movements are recorded instead of poses.
  void RecordEvaluated(const protocol::Movements& movements);
  void EncodeBlock(const protocol::CompactCodec& codec);

  /// Must be called after the last part of a batch. Unless the batch is partial, marks every avatar
  /// with the batch's shard and mode as gone if no part of the batch contained it.
  void MarkMissingAsGone(const protocol::PoseBatchInfo& info);
  /// Erases avatars that have been gone for longer than kKeepGoneS.
  void EraseGone(double time_s);
  /// Erases the tracks for which `is_erased` returns true.
  template <typename Predicate>
  void EraseTracks(const Predicate& is_erased);
  void SetGone(Track& track, bool gone);

  std::size_t pose_history_;
  PoseBudget& budget_;
  Evaluation evaluation_;
  std::unique_ptr<MovementEvaluator> evaluator_;  // Null before the first movement.
  bool has_info_ = false;
  protocol::SkeletonInfo skeleton_;
  std::string library_hash_;
  std::vector<std::string> layers_;
  std::shared_ptr<const protocol::CompactCodecs> codecs_;  ///< Codecs of compact poses, or null.
  std::optional<std::set<protocol::AvatarId>> filter_;
  std::vector<Track> tracks_;  // In ascending order of avatar ids.
  // Index after the last track that was found, where the next search starts.
  std::size_t next_track_ = 0;
  std::size_t prefetched_track_ = 0;  // Same as next_track_, for Prefetch.
  std::size_t gone_count_ = 0;        // Number of tracks that are gone.
  std::map<Lane, Shard> shards_;
  std::map<protocol::AvatarId, std::uint64_t> left_;  // Tick at which each avatar left the region.
  std::uint64_t epoch_ = 1;
  /// Last assigned segment. It is never reset, so that no two sessions use the same segment.
  std::uint32_t last_segment_ = 0;
  std::uint64_t revision_ = 0;
  PoseRecording recording_;
  double newest_time_s_ = -std::numeric_limits<double>::infinity();
  std::vector<Quat> scratch_;
  std::map<std::uint16_t, ShardTicks> shard_ticks_;
  // Message to apply, and the ticks of its shard. Set while Apply(Movements) runs.
  const protocol::Movements* message_ = nullptr;
  ShardTicks* ticks_ = nullptr;
  std::vector<protocol::AvatarId> ended_;  // See TakeEnded.
  std::uint64_t recording_number_ = 0;     // MovementRecording::number() at the last message.
  std::uint64_t updated_tick_ = 0;         // Tick of the last UpdateContinued.
  std::size_t updated_track_ = 0;          // Track at which the next UpdateContinued starts.
  double tick_s_ = 0.0;                    // ReplicaSet::tick_s() in the last Apply.
  double sampled_s_ = 0.0;                 // Time of the last SampleAll.
  struct SampledTrack {
    std::size_t track;
    bool is_continued;  // The pose is that of Track::continued.
  };
  std::vector<SampledTrack> sampled_tracks_;  // Scratch memory of SampleAll.
  // Interval of poses in ticks, as requested. Set while Apply(Movements) runs.
  std::uint64_t replica_every_n_ticks_ = 1;
  const ReplicaSet* replicas_ = nullptr;  // Set while Apply(Movements) runs.
  Counts* replica_counts_ = nullptr;      // Counters to update. Set while Apply(Movements) runs.
  // Avatars of one message whose movements are recorded.
  std::vector<protocol::AvatarId> moving_;
  // Other poses of one message for the recording, in the order of evaluation, and their encoding.
  // The last poses are still in `block_` and not encoded yet.
  std::vector<protocol::AvatarId> evaluated_;
  std::vector<std::uint8_t> evaluated_flags_;
  std::vector<std::byte> encoded_;
  protocol::CompactCodec::Block block_;
  bool fits_ = true;                 // False if a pose is outside the range of the compact mode.
  std::uint16_t recorded_part_ = 0;  // Distinguishes messages of the same tick in the recording.
};

}  // namespace stridewire::client
