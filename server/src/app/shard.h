#pragma once

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <map>
#include <memory>
#include <thread>
#include <vector>

#include "session/arrival.h"
#include "session/interest_tracker.h"
#include "session/session.h"
#include "session/session_host.h"
#include "world/command_inbox.h"
#include "world/world_shard.h"

namespace stridewire::server {

/// The main thread, which owns the lists of sessions and worlds.
class ServerThread {
 public:
  virtual ~ServerThread() = default;
  /// Sends a message to the main thread. Any thread may call it; it returns at once.
  virtual void Post(ServerMessage message) = 0;
};

/// One thread with one io_context. It owns some of the avatars of every world and some of the
/// sessions.
///
///   tick n:  execute the commands in the inbox -> advance each avatar -> encode each pose once
///            -> post one ShardOutbox to each shard whose sessions need something
///   then:    each shard passes complete batches to its sessions, or composes smaller batches for
///            sessions that observe selected avatars or a region
///
/// A received command only enters the inboxes of the shards that execute it. Shards exchange data
/// with Post. They share World and AvatarBudget, which are safe to use from several threads.
class Shard : public SessionHost {
 public:
  /// Borrows all references.
  Shard(int index, const Config& config, AvatarBudget& budget, ThreadMetrics& metrics,
        ServerThread& server);
  ~Shard() override;

  /// Must be called before any shard starts. `shards` contains all shards, including this one.
  void Prepare(const TickClock& clock, std::vector<Shard*> shards);
  /// Starts the thread.
  void Start();
  /// Ends the thread without waiting for pending work.
  void Stop();
  /// Closes the remaining connections and finishes their pending operations, so that nothing of
  /// this shard stays in another io_context. Must be called after all shards have stopped.
  void CloseConnections();

  // These functions may be called by any thread:

  /// Sends a message to this shard, which handles it on its own thread.
  void Post(ShardMessage message);
  /// Passes a client to this shard. The client has already sent its Hello.
  void Adopt(Arrival arrival);
  /// Ends all sessions after answering their pending commands.
  void Drain();
  /// Calls `done` on this shard's thread when all its connections are closed.
  void WhenDrained(std::function<void()> done);

 private:
  // SessionHost.
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
  void SendToShard(int shard, ShardMessage message) override;
  void SendToServer(ServerMessage message) override { server_.Post(std::move(message)); }
  void DestroySession(SessionId session) override;
  void InterestChanged(const std::shared_ptr<World>& world) override;
  void SelectionChanged(WorldId world) override { interests_.SelectionChanged(world); }

  // Ticks.
  void ScheduleTick();
  void Tick();
  void AnswerRequests();
  void Publish();
  void PublishPoses(WorldShard& world);
  void ScheduleHousekeeping();
  void UpdateGauges();

  // Messages.
  void Handle(ShardMessage&& message);
  void Deliver(ShardOutbox&& outbox);
  void AdoptNow(Arrival&& arrival);
  Session* FindSession(SessionId session);
  WorldShard& WorldOf(const std::shared_ptr<World>& world);

  const int index_;
  const Config& config_;
  AvatarBudget& budget_;
  ThreadMetrics& metrics_;
  ServerThread& server_;
  std::vector<Shard*> shards_;
  TickClock clock_;

  boost::asio::io_context context_{1};
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_;
  boost::asio::steady_timer tick_timer_;
  boost::asio::steady_timer housekeeping_timer_;
  std::jthread thread_;

  std::uint64_t tick_ = 0;
  CommandInbox inbox_;
  std::vector<InspectRequest> inspect_requests_;  // Requests that are answered after the next tick.
  std::vector<StatesRequest> states_requests_;    // Requests that are answered after the next tick.
  std::map<WorldId, std::unique_ptr<WorldShard>> worlds_;
  // Scratch memory of the libraries in use.
  std::map<const MotionLibrary*, std::weak_ptr<PoseScratch>> scratch_;
  std::map<SessionId, std::unique_ptr<Session>> sessions_;
  InterestTracker interests_;  // Combined interests of sessions_.
  protocol::Encoder encoder_;
  protocol::PoseBatchComposer composer_;
  std::map<int, ShardOutbox> outboxes_;  // Outboxes by receiving shard; only those with contents.
  std::vector<std::weak_ptr<Connection>> connections_;
  bool is_draining_ = false;
};

}  // namespace stridewire::server
