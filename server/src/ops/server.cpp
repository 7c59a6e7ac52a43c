#include "ops/server.h"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <boost/asio/post.hpp>
#include <csignal>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "net/tcp_transport.h"
#include "stridewire/base/version.h"

namespace stridewire::server {

namespace asio = boost::asio;

namespace {

constexpr const char* kNoViewerPage = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Stridewire</title></head><body>
<h1>Stridewire</h1>
<p>This server runs, but it has no viewer. To have one here, in the project's folder (needs npm):</p>
<pre>cmake --preset release -DSTRIDEWIRE_BUILD_VIEWER=ON
cmake --build --preset release --target viewer</pre>
<p>and start build/release/bin/stridewired again, or name the folder of a viewer by
<code>--viewer-dir</code>.</p>
<p>Worlds: <a href="/info.json">info.json</a>. Health: <a href="/healthz">healthz</a>,
<a href="/readyz">readyz</a>, <a href="/metrics">metrics</a>. Streams: /stream, a WebSocket.</p>
</body></html>
)";

constexpr std::uint64_t kGroundTicksAhead = 3;

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
      http_(config_.limits.max_http_connections, metrics_.ops()),
      gate_(context_, config_.limits, metrics_.ops(), sessions_,
            [this](int shard, Shard::Arrival arrival) {
              shards_[static_cast<std::size_t>(shard)]->Adopt(std::move(arrival));
            }),
      signals_(context_),
      housekeeping_timer_(context_),
      drain_timer_(context_) {
  for (int i = 0; i < config_.shard_count(); ++i) {
    shards_.push_back(
        std::make_unique<Shard>(i, config_, avatar_budget_, metrics_.shard(i), *this));
  }
}

Server::~Server() {
  // All threads end before any shard goes: they post to each other.
  for (const auto& shard : shards_) shard->Stop();
  for (const auto& shard : shards_) shard->CloseConnections();
}

Status Server::Start() {
  if (Status status = listener_.Open(config_.listen, "listen"); !status) return status;
  if (config_.http_enabled) {
    if (Status status = http_listener_.Open(config_.http, "http"); !status) return status;
    AddPages();
    if (!viewer_.empty()) {
      spdlog::info("the viewer at / has {} files, {} bytes", viewer_.count(), viewer_.bytes());
    }
    http_listener_.Start([this](auto socket) { http_.Accept(std::move(socket)); });
  }
  if (!IsLoopback(config_.listen)) {
    spdlog::warn(
        "listening on {} WITHOUT tokens and TLS: whoever can reach it can command every avatar",
        ToText(config_.listen));
  }
  if (config_.http_enabled && !IsLoopback(config_.http)) {
    spdlog::warn("streaming on {} WITHOUT tokens and TLS: the same holds there",
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
    if (error) return;  // gone already
    gate_.Accept(MakeTcpTransport(std::move(socket)), remote.address());
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
      spdlog::warn("signal {} again: ending at once", signal);
      Finish(false);
      return;
    }
    spdlog::info("signal {}: draining", signal);
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
  gate_.Close();
  shards_to_drain_ = static_cast<int>(shards_.size());
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
    spdlog::warn("some clients did not take what was theirs in {} s", config_.drain_timeout_s);
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
    for (const WorldId world : worlds_.DropEmpty()) spdlog::debug("world {} ends", world);
    metrics_.set_world_count(worlds_.size());
    ScheduleHousekeeping();
  });
}

// ---- from the shards

void Server::JoinWorld(int shard, SessionId session, protocol::Seq seq, std::string name) {
  asio::post(context_, [this, shard, session, seq, name = std::move(name)] {
    auto joined = worlds_.Join(name);
    metrics_.set_world_count(worlds_.size());
    if (!joined && joined.error().code == protocol::StatusCode::kLimitReached) {
      metrics_.ops().Reached(Limit::kWorlds);
    }
    shards_[static_cast<std::size_t>(shard)]->Deliver(session, seq, std::move(joined));
  });
}

void Server::LeaveWorld(WorldId world) {
  asio::post(context_, [this, world] { worlds_.Leave(world); });
}

void Server::SetTerrain(TerrainChange change) {
  asio::post(context_, [this, change = std::move(change)]() mutable {
    auto ground = worlds_.SetTerrain(*change.world, std::move(change.terrain));
    if (!ground) {
      shards_[static_cast<std::size_t>(change.from_shard)]->RefuseTerrain(
          change.session, change.seq, std::move(ground.error()));
      return;
    }
    // Far enough ahead that every shard has it in time.
    const std::uint64_t tick = clock_.TickAt(TickClock::Clock::now()) + kGroundTicksAhead;
    for (const auto& shard : shards_) {
      shard->ChangeTerrain({.world = change.world,
                           .from_shard = change.from_shard,
                           .session = change.session,
                           .seq = change.seq,
                           .part = TerrainPart{*ground, tick}});
    }
  });
}

void Server::SessionEnded(SessionId session) {
  asio::post(context_, [this, session] { sessions_.Close(session); });
}

void Server::SessionBegan(int shard, SessionIdentity identity) {
  asio::post(context_,
             [this, shard, identity = std::move(identity)] { sessions_.Restore(shard, identity); });
}

// ---- HTTP

void Server::AddPages() {
  http_.ServeStream(
      "/stream", OriginPolicy(config_.allowed_origins, IsLoopback(config_.http)),
      [this] { return !is_draining_; },
      [this](std::unique_ptr<Transport> transport, const asio::ip::address& remote) {
        gate_.Accept(std::move(transport), remote);
      });
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
    // What a library's file is called, not where it lies.
    library_pages_.Add(name.substr(name.rfind('/') + 1), library);
  }
  http_.SetWork("/libraries", [this](const HttpQuery& query) {
    auto answer = library_pages_.Answer(query);
    return answer ? *std::move(answer) : HttpAnswer{.status = 404, .body = "no such page\n"};
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
    return file ? *std::move(file) : HttpAnswer{.status = 404, .body = "no such page\n"};
  });
}

std::string Server::InfoText() const {
  // What a library's file is called, not where it lies.
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
