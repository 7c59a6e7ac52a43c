#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "app/http_server.h"
#include "app/libraries.h"
#include "app/library_pages.h"
#include "app/shard.h"
#include "app/terrains.h"
#include "app/viewer_files.h"
#include "app/world_directory.h"
#include "base/config.h"
#include "base/metrics.h"
#include "net/listener.h"
#include "session/handshake.h"
#include "session/session_directory.h"

namespace stridewire::server {

/// The complete server. The main thread, which calls Run, accepts connections, performs handshakes,
/// answers HTTP requests and owns the lists of sessions and worlds. Each shard has its own thread.
class Server : public ServerThread {
 public:
  Server(Config config, Libraries libraries, ViewerFiles viewer = {}, Terrains terrains = {});
  ~Server() override;
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Binds the addresses and starts the shards. On failure returns kIo; `where` contains the option
  /// and the address.
  [[nodiscard]] Status Start();

  /// Drains on the first SIGTERM or SIGINT, and stops at once on the second.
  void WatchSignals();

  /// Runs until the server is drained or stopped. Returns true if it was drained.
  bool Run();

  /// Stops accepting clients, answers accepted commands, closes all sessions, and makes Run return,
  /// at the latest after drain_timeout_s. Thread-safe.
  void Drain();
  /// Makes Run return at once. Thread-safe.
  void Stop();

  // Valid after Start.
  [[nodiscard]] Endpoint listen_endpoint() const { return listener_.endpoint(); }
  [[nodiscard]] Endpoint http_endpoint() const { return http_listener_.endpoint(); }
  [[nodiscard]] const Config& config() const { return config_; }
  [[nodiscard]] Metrics& metrics() { return metrics_; }
  /// Returns the line `ready listen=... http=... library=... shards=...`.
  [[nodiscard]] std::string ReadyLine() const;

 private:
  // Implements ServerThread. Handle runs on the main thread.
  void Post(ServerMessage message) override;
  void Handle(ServerMessage&& message);
  void Join(JoinRequest&& request);
  void SetTerrain(TerrainChange&& change);
  [[nodiscard]] Shard& ShardAt(int index) { return *shards_.at(static_cast<std::size_t>(index)); }

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
  Handshakes handshakes_;
  boost::asio::signal_set signals_;
  boost::asio::steady_timer housekeeping_timer_;
  boost::asio::steady_timer drain_timer_;
  int shards_to_drain_ = 0;
  bool is_draining_ = false;
  bool was_drained_ = false;
};

}  // namespace stridewire::server
