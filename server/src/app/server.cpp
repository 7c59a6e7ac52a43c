#include "app/server.h"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <boost/asio/post.hpp>
#include <csignal>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/check.h"
#include "net/tcp_transport.h"
#include "stridewire/base/version.h"

namespace stridewire::server {

namespace asio = boost::asio;

namespace {

constexpr const char* kNoViewerPage = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Stridewire</title></head><body>
<h1>Stridewire</h1>
<p>This server has no viewer. To build one, run in the project folder (requires npm):</p>
<pre>cmake --preset release -DSTRIDEWIRE_BUILD_VIEWER=ON
cmake --build --preset release --target viewer</pre>
<p>Then restart build/release/bin/stridewired, or set the folder of a viewer with
<code>--viewer-dir</code>.</p>
<p>Worlds: <a href="info.json">info.json</a>. Health: <a href="healthz">healthz</a>,
<a href="readyz">readyz</a>, <a href="metrics">metrics</a>. Streams: /stream, a WebSocket.</p>
</body></html>
)";

// A new terrain applies after this many ticks, so that every shard receives it in time.
constexpr std::uint64_t kTerrainTicksAhead = 3;

}  // namespace

Server::Server(Config config, Libraries libraries, ViewerFiles viewer, Terrains terrains)
    : config_(std::move(config)),
      libraries_(std::move(libraries)),
      terrains_(std::move(terrains)),
      viewer_(std::move(viewer)),
      metrics_(config_.shard_count()),
      avatar_budget_(config_.limits.max_avatars_per_world, config_.limits.max_avatars),
      worlds_(config_, libraries_, terrains_),
      sessions_(config_.limits, config_.shard_count()),
      clock_(TickClock::Clock::time_point{}, config_.tick_hz),
      listener_(context_),
      http_listener_(context_),
      http_(config_.limits.max_http_connections, metrics_.main()),
      handshakes_(context_, config_.limits, metrics_.main(), sessions_,
                  [this](int shard, Arrival arrival) { ShardAt(shard).Adopt(std::move(arrival)); }),
      signals_(context_),
      housekeeping_timer_(context_),
      drain_timer_(context_) {
  for (int i = 0; i < config_.shard_count(); ++i) {
    shards_.push_back(
        std::make_unique<Shard>(i, config_, avatar_budget_, metrics_.shard(i), *this));
  }
}

Server::~Server() {
  // Shards post to each other, so all threads must end before the first shard is destroyed.
  for (const auto& shard : shards_) shard->Stop();
  for (const auto& shard : shards_) shard->CloseConnections();
}

Status Server::Start() {
  if (Status status = listener_.Open(config_.listen, "listen"); !status) return status;
  if (config_.http_enabled) {
    if (Status status = http_listener_.Open(config_.http, "http"); !status) return status;
    AddPages();
    if (!viewer_.empty()) {
      spdlog::info("serving the viewer: {} files, {} bytes", viewer_.count(), viewer_.bytes());
    }
    http_listener_.Start([this](auto socket) { http_.Accept(std::move(socket)); });
  }
  if (!IsLoopback(config_.listen)) {
    spdlog::warn("listening on {} without tokens and TLS: any client can command all avatars",
                 ToText(config_.listen));
  }
  if (config_.http_enabled && !IsLoopback(config_.http)) {
    spdlog::warn("serving /stream on {} without tokens and TLS: any client can command all avatars",
                 ToText(config_.http));
  }
  clock_ = TickClock(TickClock::Clock::now(), config_.tick_hz);
  std::vector<Shard*> peers;
  for (const auto& shard : shards_) peers.push_back(shard.get());
  for (const auto& shard : shards_) shard->Prepare(clock_, peers);
  for (const auto& shard : shards_) shard->Start();
  listener_.Start([this](auto socket) {
    boost::system::error_code error;
    const auto remote = socket.remote_endpoint(error);
    if (error) return;  // The peer has closed the connection.
    handshakes_.Accept(MakeTcpTransport(std::move(socket)), remote.address());
  });
  ScheduleHousekeeping();
  spdlog::info("stridewired {} ready: {} shards, {} Hz, library {} ({})", kVersion, shards_.size(),
               config_.tick_hz, config_.library, libraries_.Find(config_.library)->hash());
  return {};
}

std::string Server::ReadyLine() const {
  return fmt::format("ready listen={} http={} library={} shards={}", ToText(listen_endpoint()),
                     config_.http_enabled ? ToText(http_endpoint()) : "off", config_.library,
                     shards_.size());
}

void Server::WatchSignals() {
  signals_.add(SIGTERM);
  signals_.add(SIGINT);
  signals_.async_wait([this](const boost::system::error_code& error, int signal) {
    if (error) return;
    if (is_draining_) {
      spdlog::warn("received signal {} again: stopping at once", signal);
      Finish(false);
      return;
    }
    spdlog::info("received signal {}: draining", signal);
    DoDrain();
    WatchSignals();
  });
}

bool Server::Run() {
  context_.run();
  for (const auto& shard : shards_) shard->Stop();
  return was_drained_;
}

void Server::Drain() {
  asio::post(context_, [this] { DoDrain(); });
}

void Server::Stop() {
  asio::post(context_, [this] { Finish(false); });
}

void Server::DoDrain() {
  if (is_draining_) return;
  is_draining_ = true;
  listener_.Close();
  handshakes_.Close();
  shards_to_drain_ = static_cast<int>(shards_.size());
  STRIDEWIRE_CHECK(shards_to_drain_ > 0);
  for (const auto& shard : shards_) {
    shard->Drain();
    shard->WhenDrained([this] {
      asio::post(context_, [this] {
        if (--shards_to_drain_ == 0) Finish(true);
      });
    });
  }
  drain_timer_.expires_after(std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(config_.drain_timeout_s)));
  drain_timer_.async_wait([this](const boost::system::error_code& error) {
    if (error) return;
    spdlog::warn(
        "some clients did not receive their pending messages within {} s (drain_timeout_s)",
        config_.drain_timeout_s);
    Finish(true);
  });
}

void Server::Finish(bool is_drained) {
  was_drained_ = is_drained;
  context_.stop();
}

void Server::ScheduleHousekeeping() {
  housekeeping_timer_.expires_after(std::chrono::milliseconds(500));
  housekeeping_timer_.async_wait([this](const boost::system::error_code& error) {
    if (error) return;
    for (const WorldId world : worlds_.DropEmpty()) spdlog::debug("removed world {}", world);
    metrics_.set_world_count(worlds_.size());
    ScheduleHousekeeping();
  });
}

// ---- messages from the shards

void Server::Post(ServerMessage message) {
  asio::post(context_,
             [this, message = std::move(message)]() mutable { Handle(std::move(message)); });
}

void Server::Handle(ServerMessage&& message) {
  std::visit(
      [this]<typename T>(T& content) {
        if constexpr (std::is_same_v<T, JoinRequest>) {
          Join(std::move(content));
        } else if constexpr (std::is_same_v<T, LeaveNotice>) {
          worlds_.Leave(content.world);
        } else if constexpr (std::is_same_v<T, TerrainChange>) {
          SetTerrain(std::move(content));
        } else if constexpr (std::is_same_v<T, SessionEnded>) {
          sessions_.Close(content.session);
        } else {
          static_assert(std::is_same_v<T, SessionRestored>);
          sessions_.Restore(content.shard, content.identity);
        }
      },
      message);
}

void Server::Join(JoinRequest&& request) {
  auto joined = worlds_.Join(request.name);
  metrics_.set_world_count(worlds_.size());
  if (!joined && joined.error().code == protocol::StatusCode::kLimitReached) {
    metrics_.main().Reached(Limit::kWorlds);
  }
  ShardAt(request.from_shard)
      .Post(JoinResult{.session = request.session, .seq = request.seq, .world = std::move(joined)});
}

void Server::SetTerrain(TerrainChange&& change) {
  auto terrain = worlds_.SetTerrain(*change.world, std::move(change.terrain));
  if (!terrain) {
    ShardAt(change.from_shard)
        .Post(TerrainRefusal{
            .session = change.session, .seq = change.seq, .refusal = std::move(terrain.error())});
    return;
  }
  const std::uint64_t tick = clock_.TickAt(TickClock::Clock::now()) + kTerrainTicksAhead;
  for (const auto& shard : shards_) {
    shard->Post(WorldCommand{.world = change.world,
                             .from_shard = change.from_shard,
                             .session = change.session,
                             .seq = change.seq,
                             .part = TerrainPart{*terrain, tick}});
  }
}

// ---- HTTP

void Server::AddPages() {
  auto proxies = TrustedProxies::Parse(config_.trusted_proxies);
  STRIDEWIRE_CHECK(proxies.has_value());  // The configuration was checked when it was read.
  http_.ServeStream(
      {.path = "/stream",
       .policy = OriginPolicy(config_.allowed_origins, IsLoopback(config_.http)),
       .proxies = *std::move(proxies),
       .is_open = [this] { return !is_draining_; },
       .on_stream =
           [this](std::unique_ptr<Transport> transport, const asio::ip::address& client) {
             handshakes_.Accept(std::move(transport), client);
           }});
  http_.AddPage("/healthz", [](const HttpQuery&) { return HttpAnswer{.body = "ok\n"}; });
  http_.AddPage("/readyz", [this](const HttpQuery&) {
    return is_draining_ ? HttpAnswer{.status = 503, .body = "draining\n"}
                        : HttpAnswer{.body = "ready\n"};
  });
  http_.AddPage("/metrics", [this](const HttpQuery&) {
    return HttpAnswer{.content_type = "text/plain; version=0.0.4; charset=utf-8",
                      .body = metrics_.Text()};
  });
  http_.AddPage("/info.json", [this](const HttpQuery&) {
    return HttpAnswer{.content_type = "application/json", .body = InfoText()};
  });
  for (const auto& [name, library] : libraries_.All()) {
    // The pages contain the file name of a library, but not its folder.
    library_pages_.Add(name.substr(name.rfind('/') + 1), library);
  }
  http_.SetSlowPage("/libraries", [this](const HttpQuery& query) {
    auto answer = library_pages_.Answer(query);
    return answer ? *std::move(answer) : HttpAnswer{.status = 404, .body = "not found\n"};
  });
  if (viewer_.empty()) {
    http_.AddPage("/", [](const HttpQuery&) {
      return HttpAnswer{.content_type = "text/html; charset=utf-8",
                        .body = kNoViewerPage,
                        .headers = PageHeaders()};
    });
  }
  http_.SetFallback([this](const HttpQuery& query) {
    auto file = viewer_.Answer(query);
    return file ? *std::move(file) : HttpAnswer{.status = 404, .body = "not found\n"};
  });
}

std::string Server::InfoText() const {
  // The page contains the file name of a library, but not its folder.
  const auto library_name = [this](const std::string& world) {
    const auto it = config_.worlds.find(world);
    const bool has_own = it != config_.worlds.end() && !it->second.library.empty();
    const std::string& path = has_own ? it->second.library : config_.library;
    return path.substr(path.rfind('/') + 1);
  };
  std::map<std::string, std::int64_t> avatars;
  for (const auto& [name, world] : config_.worlds) avatars[name] = 0;
  worlds_.ForEach([&](const World& world) { avatars[world.name] = world.avatar_count.load(); });
  nlohmann::ordered_json worlds = nlohmann::ordered_json::array();
  for (const auto& [name, count] : avatars) {
    worlds.push_back({{"name", name}, {"library", library_name(name)}, {"avatars", count}});
  }
  const nlohmann::ordered_json info = {{"version", kVersion},
                                       {"tick_hz", config_.tick_hz},
                                       {"shards", shards_.size()},
                                       {"listen", ToText(listen_endpoint())},
                                       {"open_worlds", config_.open_worlds},
                                       {"worlds", worlds}};
  return info.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace stridewire::server
