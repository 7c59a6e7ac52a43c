#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pose_history.h"
#include "replica_set.h"
#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::client {

/// Memory that all pose histories of a client share.
struct PoseBudget {
  std::size_t limit_bytes = 0;
  std::size_t used_bytes = 0;
};

/// What is seen of a world: its figure, and the poses of its avatars.
class WorldView : public PoseSink {
 public:
  /// Poses of an avatar that is gone can still be sampled for this long.
  static constexpr double kKeepGone_s = 2.0;
  /// How long it is remembered that an avatar has left: batches wait for a few ticks at most.
  static constexpr std::uint64_t kKeepLeftTicks = 600;
  /// More shards than this in one world are refused.
  static constexpr std::size_t kMaxShards = 1024;

  struct Counts {
    std::uint64_t batches = 0;
    std::uint64_t poses = 0;
    std::uint64_t refused = 0;  ///< No memory, or not after the newest.
    std::uint64_t missing = 0;  ///< Batches, by gaps in the ticks.
  };

  WorldView(std::size_t pose_history, PoseBudget& budget)
      : pose_history_(pose_history), budget_(budget) {}
  ~WorldView() override { Clear(); }
  WorldView(const WorldView&) = delete;
  WorldView& operator=(const WorldView&) = delete;

  /// The world was joined, or joined again. Another figure than before clears the poses.
  void SetInfo(const protocol::WorldInfo& info);
  [[nodiscard]] bool has_info() const { return has_info_; }
  [[nodiscard]] const protocol::SkeletonInfo& skeleton() const { return skeleton_; }
  [[nodiscard]] const std::string& library_hash() const { return library_hash_; }
  [[nodiscard]] const std::vector<std::string>& layers() const { return layers_; }

  /// Forgets figure and poses.
  void Clear();
  void ClearPoses();

  /// Marks that what comes next does not continue what was there before (a connection resumed, a
  /// subscription begun), though the server cannot say so in a shared batch.
  void Break() { ++epoch_; }

  /// Which avatars' poses to keep; empty: all.
  void SetFilter(std::optional<std::set<protocol::AvatarId>> filter);

  /// Takes in one batch. `every_n_ticks` is the rate asked for, to count gaps. kMalformed and others:
  /// a pose that is none, or another figure than announced; what came before it is kept.
  Status Take(const protocol::PoseBatch& batch, std::uint64_t every_n_ticks, Counts& counts);

  /// Poses that are evaluated here, of every `every_n_ticks`th tick: OnPose and OnGone until `tick` is over.
  Status Take(const protocol::Movements& movements, ReplicaSet& evaluated,
              std::uint64_t every_n_ticks, Counts& counts);

  /// The server said that the avatar is gone.
  void Remove(protocol::AvatarId avatar);
  /// It has left the region observed at that tick; poses from before it that are still on their way do not
  /// bring it back.
  void Leave(protocol::AvatarId avatar, std::uint64_t tick);

  /// Nullptr if nothing is known of it.
  [[nodiscard]] const PoseHistory* Find(protocol::AvatarId avatar) const;
  [[nodiscard]] bool IsGone(protocol::AvatarId avatar) const;

  /// Avatars that are there, in growing order.
  [[nodiscard]] std::vector<protocol::AvatarId> Avatars() const;

 private:
  struct Track {
    std::unique_ptr<PoseHistory> history;
    std::uint16_t shard = 0;
    protocol::PoseMode mode = protocol::PoseMode::kFull;
    std::uint64_t seen_tick = 0;
    std::uint64_t epoch = 0;
    bool gone = false;
  };
  struct Shard {
    std::uint64_t tick = 0;  ///< Of the batch whose parts are coming in.
    std::uint32_t parts_seen = 0;
    std::uint64_t epoch = 0;
    protocol::PoseMode mode = protocol::PoseMode::kFull;
  };
  using Lane = std::pair<std::uint16_t, protocol::PoseMode>;  // shard, mode
  using Tracks = std::map<protocol::AvatarId, Track>;

  void OnPose(protocol::AvatarId avatar, std::uint16_t shard, const PoseStamp& stamp,
              ConstPoseSpan pose) override;
  void OnGone(protocol::AvatarId avatar) override { Remove(avatar); }
  [[nodiscard]] bool Wants(protocol::AvatarId avatar) const override {
    return !filter_ || filter_->contains(avatar);
  }
  /// The track to add a pose to; null: there is no memory for it.
  Track* TrackOf(protocol::AvatarId avatar);
  void Push(Track& track, const Lane& lane, PoseStamp stamp, const Vec3& root_position_m,
            std::span<const Quat> rotations, Counts& counts);

  /// After the last part of a shard's batch: who was not in it, but in one before, is gone.
  void Sweep(const protocol::PoseBatchInfo& info);
  /// Those who are gone for long.
  void Forget(double time_s);
  Tracks::iterator Erase(Tracks::iterator track);

  std::size_t pose_history_;
  PoseBudget& budget_;
  bool has_info_ = false;
  protocol::SkeletonInfo skeleton_;
  std::string library_hash_;
  std::vector<std::string> layers_;
  protocol::CompactCodecs codecs_;  ///< Of compact poses, if the server tells them
  std::optional<std::set<protocol::AvatarId>> filter_;
  Tracks tracks_;
  std::map<Lane, Shard> shards_;
  std::map<protocol::AvatarId, std::uint64_t> left_;  // since which tick; forgotten after a while
  std::uint64_t epoch_ = 1;
  std::vector<Quat> scratch_;
  std::uint64_t shown_every_ = 1;   // while movements are taken in
  Counts* shown_counts_ = nullptr;  // the same
};

}  // namespace stridewire::client
