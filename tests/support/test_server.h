#pragma once

#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "app/server.h"
#include "raw_client.h"

namespace stridewire {

/// Returns a configuration for tests: loopback addresses with ports that the system chooses.
[[nodiscard]] server::Config TestConfig(int shards = 2);

/// A server in this process, with real sockets. It uses the test library "test" unless the
/// configuration names another.
class TestServer {
 public:
  explicit TestServer(server::Config config = TestConfig(), server::ViewerFiles viewer = {});
  ~TestServer();
  TestServer(const TestServer&) = delete;
  TestServer& operator=(const TestServer&) = delete;

  [[nodiscard]] RawClient Connect(int receive_buffer_bytes = 0) const;
  /// Opens a session and joins a world. On failure the test fails and the returned world has id 0.
  [[nodiscard]] std::pair<RawClient, std::optional<protocol::WorldInfo>> Enter(
      const std::string& world, protocol::Role role = protocol::Role::kController) const;
  [[nodiscard]] std::uint16_t port() const { return server_->listen_endpoint().port; }
  [[nodiscard]] std::uint16_t http_port() const { return server_->http_endpoint().port; }
  [[nodiscard]] server::Server& server() { return *server_; }
  [[nodiscard]] server::Metrics& metrics() { return server_->metrics(); }

  /// Drains the server and waits for its end. Returns true if it was drained in time.
  bool DrainAndJoin();

 private:
  std::unique_ptr<server::Server> server_;
  bool was_drained_ = false;
  std::thread thread_;
};

/// Waits until `condition` returns true, at most RawClient::kPatience. Returns its last result.
template <typename Condition>
bool Eventually(Condition&& condition) {
  const auto until = std::chrono::steady_clock::now() + RawClient::kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

}  // namespace stridewire
