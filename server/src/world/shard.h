#pragma once

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "session/session.h"
#include "session/session_host.h"
#include "world/world_shard.h"

namespace stridewire::server {

/// What a shard asks of the thread that knows all sessions and worlds. Any thread may call; all
/// return at once.
class ShardPeers {
 public:
  virtual ~ShardPeers() = default;
  virtual void JoinWorld(int shard, SessionId session, protocol::Seq seq, std::string name) = 0;
  virtual void LeaveWorld(WorldId world) = 0;
  virtual void SetTerrain(TerrainChange change) = 0;
  virtual void SessionEnded(SessionId session) = 0;
  /// A session the directory had given up is there after all.
  virtual void SessionBegan(int shard, SessionIdentity identity) = 0;
};

/// One thread with one io_context: some of every world's avatars, and some sessions.
///
///   tick n:  drain the inbox of commands -> advance each avatar -> results, events, and poses
///            (each encoded once) -> one post to every shard that wants some of them
///   there:   whole batches go out as they are; for sessions that name avatars theirs are copied out
///
/// Sockets only put commands into inboxes. Shards send each other values by post and share nothing
/// else but the counters of World and AvatarBudget.
class Shard : public SessionHost {
 public:
  /// Borrows everything.
  Shard(int index, const Config& config, AvatarBudget& budget, ThreadMetrics& metrics,
        ShardPeers& peers);
  ~Shard() override;

  /// Before any shard starts. `shards` are all of them, this one included.
  void Prepare(const TickClock& clock, std::vector<Shard*> shards);
  /// Starts the thread.
  void Start();
  /// Ends the thread, whatever is under way.
  void Stop();
  /// Closes what connections are left and lets what waits on them end, so that nothing of them outlives
  /// this shard elsewhere. When all shards have stopped.
  void CloseConnections();

  // Any thread:

  /// A client that has said Hello.
  struct Arrival {
    SessionIdentity identity;
    bool is_resuming = false;
    std::unique_ptr<Transport> transport;  ///< Detached.
    protocol::Hello hello;
    std::vector<std::byte> received;
  };
  void Adopt(Arrival arrival);
  void Deliver(SessionId session, protocol::Seq seq, Outcome<std::shared_ptr<World>> joined);
  /// A world has another ground: this shard's avatars from a tick on, its sessions are told.
  void ChangeTerrain(WorldCommand command);
  void RefuseTerrain(SessionId session, protocol::Seq seq, Refusal refusal);
  void Drain();
  /// Calls `done` on this shard when its connections have sent what they had.
  void WhenDrained(std::function<void()> done);

 private:
  const Config& config() const override { return config_; }
  int shard_index() const override { return index_; }
  int shard_count() const override { return static_cast<int>(shards_.size()); }
  const TickClock& clock() const override { return clock_; }
  std::uint64_t tick() const override { return tick_; }
  bool is_draining() const override { return is_draining_; }
  AvatarBudget& avatar_budget() override { return budget_; }
  ThreadMetrics& metrics() override { return metrics_; }
  protocol::Encoder& encoder() override { return encoder_; }
  protocol::PoseBatchComposer& composer() override { return composer_; }
  void Submit(int shard, WorldCommand&& command) override;
  void Ask(int shard, Inspection&& question) override;
  void Ask(int shard, StatesQuestion&& question) override;
  void JoinWorld(SessionId session, protocol::Seq seq, std::string name) override;
  void LeaveWorld(WorldId world) override;
  void SetTerrain(TerrainChange&& change) override;
  void SessionEnded(SessionId session) override;
  void InterestChanged(const std::shared_ptr<World>& world) override;
  void RegionMoved(WorldId world) override { named_anew_.insert(world); }

  void ScheduleTick();
  void Tick();
  void RunCommands();
  void AnswerQuestions();
  void Publish();
  void Receive(ShardOutbox&& mail);
  void OnInterest(const Interest& interest);
  void Tell(const Interest& interest);
  void TellNamed();
  std::span<Session* const> WatchersOf(WorldId world) const;
  WorldShard& WorldOf(const std::shared_ptr<World>& world);
  void DoAdopt(Arrival&& arrival);
  void ScheduleHousekeeping();
  void UpdateGauges();

  const int index_;
  const Config& config_;
  AvatarBudget& budget_;
  ThreadMetrics& metrics_;
  ShardPeers& peers_;
  std::vector<Shard*> shards_;
  TickClock clock_;

  boost::asio::io_context context_{1};
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_;
  boost::asio::steady_timer tick_timer_;
  boost::asio::steady_timer housekeeping_timer_;
  std::jthread thread_;

  std::uint64_t tick_ = 0;
  std::vector<WorldCommand> inbox_;
  std::map<SessionId, CommandResult>
      spawning_;  // what has come of spawns that go on in the next tick
  std::vector<Inspection> questions_;
  std::vector<StatesQuestion> states_questions_;
  std::map<WorldId, std::unique_ptr<WorldShard>> worlds_;
  std::map<const MotionLibrary*, std::weak_ptr<PoseScratch>> scratch_;  // of its worlds' libraries
  std::map<SessionId, std::unique_ptr<Session>> sessions_;
  std::map<WorldId, std::vector<Session*>> watchers_;  // sessions that want poses or events
  std::map<WorldId, Interest> told_interest_;          // what the other shards know of this one's
  std::set<WorldId> named_anew_;  // whose avatars named and regions are told at the next tick
  protocol::Encoder encoder_;
  protocol::PoseBatchComposer composer_;
  std::vector<ShardOutbox> outgoing_;  // by shard
  std::vector<std::weak_ptr<Connection>> connections_;
  bool is_draining_ = false;
};

}  // namespace stridewire::server
