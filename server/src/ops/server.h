#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <memory>
#include <vector>

#include "net/listener.h"
#include "ops/config.h"
#include "ops/http_server.h"
#include "ops/libraries.h"
#include "ops/library_pages.h"
#include "ops/metrics.h"
#include "ops/viewer_files.h"
#include "session/handshake.h"
#include "session/session_directory.h"
#include "world/shard.h"
#include "world/world_directory.h"

namespace stridewire::server {

/// The whole server: one thread that accepts, greets, answers HTTP and keeps the lists of sessions
/// and worlds (the one that calls Run), and one thread a shard.
class Server : public ShardPeers {
 public:
  Server(Config config, Libraries libraries, ViewerFiles viewer = {}, Terrains terrains = {});
  ~Server() override;
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Opens the addresses and starts the shards. kIo names the option and the address.
  [[nodiscard]] Status Start();

  /// Drains on the first SIGTERM or SIGINT, ends at once on the second.
  void WatchSignals();

  /// Serves until it is drained or stopped. True: it was drained.
  bool Run();

  /// Any thread: stops accepting, tells every client, sends what waits, and lets Run return.
  void Drain();
  /// Any thread: lets Run return at once.
  void Stop();

  // After Start.
  [[nodiscard]] Endpoint listen_endpoint() const { return listener_.endpoint(); }
  [[nodiscard]] Endpoint http_endpoint() const { return http_listener_.endpoint(); }
  [[nodiscard]] const Config& config() const { return config_; }
  [[nodiscard]] Metrics& metrics() { return metrics_; }
  /// `ready listen=… http=… library=… shards=…`
  [[nodiscard]] std::string ReadyLine() const;

 private:
  void JoinWorld(int shard, SessionId session, protocol::Seq seq, std::string name) override;
  void LeaveWorld(WorldId world) override;
  void SetTerrain(TerrainChange change) override;
  void SessionEnded(SessionId session) override;
  void SessionBegan(int shard, SessionIdentity identity) override;

  void AddPages();
  [[nodiscard]] std::string InfoText() const;
  void ScheduleHousekeeping();
  void DoDrain();
  void Finish(bool is_drained);

  const Config config_;
  const Libraries libraries_;
  const Terrains terrains_;
  const ViewerFiles viewer_;
  LibraryPages library_pages_;
  Metrics metrics_;
  AvatarBudget avatar_budget_;
  boost::asio::io_context context_{1};
  WorldDirectory worlds_;
  SessionDirectory sessions_;
  std::vector<std::unique_ptr<Shard>> shards_;
  TickClock clock_;
  Listener listener_;
  Listener http_listener_;
  HttpServer http_;
  Gate gate_;
  boost::asio::signal_set signals_;
  boost::asio::steady_timer housekeeping_timer_;
  boost::asio::steady_timer drain_timer_;
  int shards_to_drain_ = 0;
  bool is_draining_ = false;
  bool was_drained_ = false;
};

}  // namespace stridewire::server
