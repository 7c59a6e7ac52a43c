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

/// What an observer counted; read it when its thread has ended.
struct ObserverCounts {
  std::uint64_t poses_received = 0;
  std::uint64_t poses_moving = 0;
  std::uint64_t poses_invalid = 0;
  std::uint64_t poses_excused = 0;  ///< Not expected: it was away by our own doing (churn).
  std::uint64_t bytes_received = 0;
  std::uint64_t batches_dropped = 0;
};

/// A session that watches worlds and counts and checks what it sees.
///
/// Checked: known world, mode and number of joints as agreed, ticks that grow, no avatar twice in
/// a tick, poses that decode (finite, unit quaternions), and no root that moves faster than
/// kMaxSpeedMPerS without being flagged as a discontinuity.
class Observer final : public Session {
 public:
  static constexpr double kMaxSpeedMPerS = 15.0;
  static constexpr double kSpeedSlackM = 0.05;
  /// Who came back by our own doing is not expected to see an avatar sooner: in mode movement states are
  /// told a tick or more after the first message.
  static constexpr double kBackS = 1.0;

  /// The first of them, `observers` of the options, watch all avatars, the others some.
  /// `probes` not null: this one's poses measure the latency; it lives on the probes' thread, and watches all.
  Observer(ThreadContext& context, const boost::asio::ip::tcp::endpoint& server, RunState& run,
           int index, LatencyProbes* probes);

  /// It has seen every avatar it watches.
  [[nodiscard]] bool sees_all() const { return sees_all_.load(); }
  /// It has seen the last tick of the window from every shard.
  [[nodiscard]] bool saw_last_tick() const { return saw_last_tick_.load(); }
  [[nodiscard]] std::uint64_t latest_tick() const { return latest_tick_.load(); }

  /// Avatars it watches.
  [[nodiscard]] std::uint64_t avatar_count() const { return avatar_count_; }
  /// Counts, with the time it was away at the end.
  [[nodiscard]] ObserverCounts Counts() const;

 private:
  struct Seen {
    std::uint64_t tick = 0;        ///< Of its last pose; 0: none yet on this connection
    std::uint64_t root_tick = 0;   ///< Of `root_m`; 0: not known
    std::uint64_t away_since = 0;  ///< First tick not seen by our own doing; 0: not away
    Vec3 root_m = Vec3(0.0f);
  };

  /// Stream of batches: one a shard and part.
  struct Stream {
    std::uint32_t key = 0;
    std::uint64_t tick = 0;
    std::uint64_t avatar_count = 0;
  };

  struct World {
    int index = 0;
    std::size_t joint_count = 0;
    std::vector<protocol::AvatarId> watched;  ///< Growing; empty: all
    std::vector<Seen> seen;                   ///< Of each of them
    std::uint64_t back_tick = 0;              ///< First seen on this connection; 0: none yet
    protocol::CompactCodecs codecs;           ///< Of compact poses, if the server tells them
    /// Only to measure latency: all poses, as they came, each with room for the longest.
    std::vector<std::byte> last_poses;
    std::vector<std::size_t> last_sizes;
    std::size_t most_pose_bytes = 0;
    std::vector<Stream> streams;
    std::unique_ptr<client::ReplicaSet> evaluated;  ///< In mode movement.
    std::uint64_t batches_dropped = 0;              ///< As the server told on this connection
  };

  void OnWelcome() override;
  void OnMessage(protocol::Message& message, std::size_t frame_bytes, std::int64_t now_ns) override;
  void OnLost(const std::string& why, bool by_us) override;

  void WatchSome(std::size_t which);
  /// Where a pose of that avatar is counted; empty: it is not ours, or not watched.
  [[nodiscard]] std::optional<std::size_t> IndexIn(const World& world,
                                                   protocol::AvatarId number) const;
  void OnWorldInfo(const protocol::WorldInfo& info);
  /// What poses come in.
  [[nodiscard]] protocol::PoseMode SentMode() const;
  void OnReply(const protocol::Reply& reply);
  void OnMovements(const protocol::Movements& movements, std::size_t frame_bytes,
                   std::int64_t now_ns);
  void OnBatch(const protocol::PoseBatch& batch, std::size_t frame_bytes, std::int64_t now_ns);
  void TakePoses(World& world, const protocol::PoseBatch& batch, std::int64_t now_ns);
  /// How many poses of that avatar were not to be expected before one of `tick`.
  [[nodiscard]] std::uint64_t ExcusedBefore(const World& world, const Seen& seen,
                                            std::uint64_t tick) const;
  /// False: the batch is not to be counted.
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
  std::map<protocol::WorldId, std::size_t> world_by_id_;   ///< -> worlds_
  std::map<protocol::Seq, std::size_t> pending_joins_;     ///< -> worlds_
  std::map<protocol::Seq, std::size_t> pending_observes_;  ///< -> worlds_
  std::uint64_t seen_count_ = 0;
  std::uint64_t batch_number_ = 0;
  bool was_dropped_ = false;  ///< The last connection was dropped by our own doing.
  std::vector<Quat> rotations_;
  ObserverCounts counts_;
  std::atomic<bool> sees_all_{false};
  std::atomic<bool> saw_last_tick_{false};
  std::atomic<std::uint64_t> latest_tick_{0};
};

}  // namespace stridewire::load
