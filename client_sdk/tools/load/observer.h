#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "latency_probes.h"
#include "replica_set.h"
#include "run_state.h"
#include "session.h"
#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::load {

/// Counters of an observer. Read them after its thread has ended.
struct ObserverCounts {
  std::uint64_t poses_received = 0;
  std::uint64_t poses_moving = 0;
  std::uint64_t poses_invalid = 0;
  /// Missing poses that are not errors, because this program dropped the observer (--churn).
  std::uint64_t poses_excused = 0;
  std::uint64_t bytes_received = 0;
  std::uint64_t batches_dropped = 0;
};

/// A session that observes worlds, and counts and checks the poses.
///
/// Checks of batches: the world is known, mode and number of joints are as requested, ticks
/// increase, and no avatar appears twice per tick. Checks of poses: they can be decoded, and no
/// root moves faster than kMaxSpeedMPerS without the flag for a discontinuity.
class Observer final : public Session {
 public:
  static constexpr double kMaxSpeedMPerS = 15.0;
  static constexpr double kSpeedSlackM = 0.05;
  /// Time after a reconnect in which missing poses are not errors. In movement mode, the state of
  /// an avatar arrives at least one tick after the first message.
  static constexpr double kReconnectS = 1.0;

  /// Observers with an `index` below LoadOptions::observers observe all avatars, the others only
  /// some. If `probes` is not null, this observer measures latency. It must then run on the thread
  /// of the probes and observe all avatars.
  Observer(ThreadContext& context, const boost::asio::ip::tcp::endpoint& server, RunState& run,
           int index, LatencyProbes* probes);

  /// Returns true if the observer has received a pose of every observed avatar.
  [[nodiscard]] bool sees_all() const { return sees_all_.load(); }
  /// Returns true if the observer has received the last tick of the window from every shard.
  [[nodiscard]] bool saw_last_tick() const { return saw_last_tick_.load(); }
  [[nodiscard]] std::uint64_t latest_tick() const { return latest_tick_.load(); }

  /// Number of observed avatars.
  [[nodiscard]] std::uint64_t avatar_count() const { return avatar_count_; }
  /// Returns the counters, including poses that are missing because of a disconnection at the end.
  [[nodiscard]] ObserverCounts Counts() const;

 private:
  /// State of an observed avatar.
  struct Seen {
    std::uint64_t tick = 0;        ///< Tick of the last pose on this connection; 0: none.
    std::uint64_t root_tick = 0;   ///< Tick of the pose to which `root_m` belongs; 0: unknown.
    std::uint64_t away_since = 0;  ///< First tick that was missed because of a drop; 0: none.
    Vec3 root_m = Vec3(0.0f);
  };

  /// Batches with the same shard and part number.
  struct Stream {
    std::uint32_t key = 0;
    std::uint64_t tick = 0;
    std::uint64_t avatar_count = 0;
  };

  struct World {
    int index = 0;
    std::size_t joint_count = 0;
    /// Ascending ids of the observed avatars; empty: all.
    std::vector<protocol::AvatarId> watched;
    std::vector<Seen> seen;          ///< State of each observed avatar.
    std::uint64_t first_tick = 0;    ///< First tick on this connection; 0: none.
    protocol::CompactCodecs codecs;  ///< Codecs of compact poses.
    /// Bytes of the last pose of each avatar, for detecting changes. Used to measure latency.
    std::vector<std::byte> last_poses;
    std::vector<std::size_t> last_sizes;
    std::size_t max_pose_bytes = 0;
    std::vector<Stream> streams;
    /// Evaluates poses from movements. Not null in movement mode.
    std::unique_ptr<client::ReplicaSet> replicas;
    /// Number of dropped batches that the server reported on this connection.
    std::uint64_t batches_dropped = 0;
  };

  void OnWelcome() override;
  void OnMessage(protocol::Message& message, std::size_t frame_bytes, std::int64_t now_ns) override;
  void OnLost(const std::string& why, bool by_us) override;

  /// Selects the avatars of partial observer `which`.
  void SelectAvatars(std::size_t which);
  /// Returns the index of an avatar in World::seen. Returns nullopt if this run does not observe
  /// the avatar.
  [[nodiscard]] std::optional<std::size_t> IndexIn(const World& world,
                                                   protocol::AvatarId number) const;
  void OnWorldInfo(const protocol::WorldInfo& info);
  /// Returns the mode of the batches that the server sends.
  [[nodiscard]] protocol::PoseMode SentMode() const;
  void OnReply(const protocol::Reply& reply);
  void OnMovements(const protocol::Movements& movements, std::size_t frame_bytes,
                   std::int64_t now_ns);
  void OnBatch(const protocol::PoseBatch& batch, std::size_t frame_bytes, std::int64_t now_ns);
  void TakePoses(World& world, const protocol::PoseBatch& batch, std::int64_t now_ns);
  /// Returns how many poses of an avatar are missing before `tick` because the connection was lost.
  /// Counts only poses that were due in the measured time and within the time allowed for
  /// reconnecting.
  [[nodiscard]] std::uint64_t ExcusedBefore(const World& world, const Seen& seen,
                                            std::uint64_t tick) const;
  /// Checks that the tick of a batch increases. Returns false if the batch must be ignored.
  bool AdvanceStream(World& world, const protocol::PoseBatch& batch);
  bool CheckPose(World& world, Seen& seen, const protocol::PoseBatch& batch, std::size_t i,
                 const protocol::PoseBatchReader& reader);
  void Measure(World& world, const protocol::PoseBatch& batch, std::size_t i,
               std::span<const std::byte> pose, std::int64_t now_ns);
  void Invalid(const World& world, std::uint64_t tick, const std::string& what);
  void UpdateProgress();

  RunState& run_;
  const int index_;
  LatencyProbes* probes_;
  std::uint64_t avatar_count_ = 0;
  std::vector<World> worlds_;
  // The values of these maps are indices of worlds_.
  std::map<protocol::WorldId, std::size_t> world_by_id_;
  std::map<protocol::Seq, std::size_t> pending_joins_;
  std::map<protocol::Seq, std::size_t> pending_observes_;
  std::uint64_t seen_count_ = 0;
  std::uint64_t batch_number_ = 0;
  bool was_dropped_ = false;  ///< True if this program dropped the last connection.
  std::vector<Quat> rotations_;
  ObserverCounts counts_;
  std::atomic<bool> sees_all_{false};
  std::atomic<bool> saw_last_tick_{false};
  std::atomic<std::uint64_t> latest_tick_{0};
};

}  // namespace stridewire::load
