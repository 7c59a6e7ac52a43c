#include "test_server.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "stridewire/offline/open_library.h"
#include "test_library.h"

namespace stridewire {

server::Config TestConfig(int shards) {
  server::Config config;
  config.listen.port = 0;
  config.http.port = 0;
  config.library = "test";
  config.shards = shards;
  config.log_level = "warning";
  return config;
}

TestServer::TestServer(server::Config config, server::ViewerFiles viewer) {
  server::Libraries libraries;
  libraries.Add(config.library,
                config.library == "test" ? MakeTestLibrary() : OpenLibrary(config.library).value());
  server_ =
      std::make_unique<server::Server>(std::move(config), std::move(libraries), std::move(viewer));
  if (const Status status = server_->Start(); !status) {
    std::fprintf(stderr, "cannot start the test server: %s\n", Describe(status.error()).c_str());
    std::abort();
  }
  thread_ = std::thread([this] { was_drained_ = server_->Run(); });
}

TestServer::~TestServer() {
  if (!thread_.joinable()) return;
  server_->Stop();
  thread_.join();
}

RawClient TestServer::Connect(int receive_buffer_bytes) const {
  return {"127.0.0.1", port(), receive_buffer_bytes};
}

std::pair<RawClient, std::optional<protocol::WorldInfo>> TestServer::Enter(
    const std::string& world, protocol::Role role) const {
  RawClient client = Connect();
  EXPECT_TRUE(client.SayHello());
  auto info = client.Join(world, role);
  EXPECT_TRUE(info);
  if (!info) info.emplace();
  return {std::move(client), std::move(info)};
}

bool TestServer::DrainAndJoin() {
  server_->Drain();
  thread_.join();
  return was_drained_;
}

}  // namespace stridewire
