#pragma once

#include <atomic>
#include <boost/asio/steady_timer.hpp>
#include <cstdint>
#include <map>
#include <queue>
#include <string>
#include <vector>

#include "latency_histogram.h"
#include "latency_probes.h"
#include "run_state.h"
#include "session.h"
#include "wander.h"

namespace stridewire::load {

/// Counters of a controller. Read them after its thread has ended.
struct ControllerCounts {
  std::uint64_t requests_sent = 0;
  std::uint64_t requests_accepted = 0;
  /// Number of requests that were rejected, in the Reply or later by an event.
  std::uint64_t requests_rejected = 0;
  std::map<protocol::StatusCode, std::uint64_t> rejected_by_code;
  /// Delay between the planned and the actual time at which a request is sent.
  LatencyHistogram send_late;
};

/// A simulated game server. It spawns the avatars of one world, requests movements according to a
/// plan and removes the avatars at the end. Requests that are due at the same time are sent in one
/// message.
class Controller final : public Session {
 public:
  static constexpr std::size_t kMaxItemsPerMessage = 2048;
  /// Maximum number of unanswered commands. Further requests wait, which increases their latency.
  static constexpr std::size_t kMaxUnanswered = 64;
  /// Maximum number of queued movements of a choreography per avatar.
  static constexpr std::size_t kMaxQueuedMovements = 48;

  Controller(ThreadContext& context, const boost::asio::ip::tcp::endpoint& server, RunState& run,
             int world, LatencyProbes* probes);

  /// Returns whether all avatars are spawned.
  [[nodiscard]] bool has_spawned() const { return has_spawned_.load(); }
  [[nodiscard]] bool has_cleaned_up() const { return has_cleaned_up_.load(); }

  /// Stops requesting movements.
  void StopMoving() { moves_ = false; }
  /// Removes the avatars, then finishes.
  void CleanUp();

  [[nodiscard]] const ControllerCounts& counts() const { return counts_; }

 private:
  enum class Command { kJoin, kSpawn, kSpawnAgain, kRemove, kRemoveLast, kRequest };
  struct Pending {
    Command command = Command::kJoin;
    std::vector<protocol::AvatarId> avatars;  ///< kSpawn
    std::uint64_t items = 0;                  ///< kRequest
  };
  struct Walker {
    Wanderer wanderer;
    std::size_t next = 0;  ///< Choreography: index of the avatar's next movement.
    /// Choreography: number of requested movements that have not started.
    std::size_t waiting = 0;
  };
  struct Due {
    std::int64_t at_ns = 0;
    std::size_t walker = 0;
    bool operator>(const Due& other) const { return at_ns > other.at_ns; }
  };

  void OnWelcome() override;
  void OnMessage(protocol::Message& message, std::size_t frame_bytes, std::int64_t now_ns) override;
  void OnLost(const std::string& why, bool by_us) override;

  void OnReply(const protocol::Reply& reply);
  void OnRequestReply(const protocol::Reply& reply, const Pending& pending);
  void OnSpawnReply(const protocol::Reply& reply, const Pending& pending);
  void OnEvent(const protocol::Event& event);

  void Spawn(const std::vector<protocol::AvatarId>& avatars, Command command);
  void Remove(const std::vector<protocol::AvatarId>& avatars, Command last);
  [[nodiscard]] protocol::Placement Place(protocol::AvatarId number) const;

  void StartMoving();
  void Schedule(std::size_t walker, std::int64_t at_ns);
  void ArmTimer();
  void SendDue();
  /// Adds the next movements of an avatar to `request`.
  void AddWanderPlan(const Due& due, std::int64_t now_ns, protocol::Request& request);
  void AddChoreography(std::size_t walker, std::int64_t due_ns, std::int64_t now_ns,
                       protocol::Request& request);
  void SendRequest(protocol::Request& request);
  /// Returns how many movements of a choreography may be queued per avatar.
  [[nodiscard]] std::size_t MaxQueuedMovements() const;

  RunState& run_;
  const int world_;
  LatencyProbes* probes_;  ///< Latency probes. Null: no observer of this world measures latency.
  protocol::WorldId world_id_ = 0;
  std::map<protocol::Seq, Pending> pending_;
  std::size_t spawned_count_ = 0;
  std::vector<Walker> walkers_;
  std::priority_queue<Due, std::vector<Due>, std::greater<>> due_;
  boost::asio::steady_timer timer_;
  protocol::RequestId last_request_ = 0;
  bool can_jump_ = true;
  bool moves_ = true;
  ControllerCounts counts_;
  std::atomic<bool> has_spawned_{false};
  std::atomic<bool> has_cleaned_up_{false};
};

}  // namespace stridewire::load
