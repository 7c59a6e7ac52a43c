#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <random>
#include <thread>
#include <utility>
#include <vector>

namespace stridewire::test {

/// A TCP proxy on the loopback interface that delays, stalls and cuts the connections to a server.
/// It serves one connection at a time.
class LinkProxy {
 public:
  struct Link {
    double latency_s = 0.0;
    double jitter_s = 0.0;       ///< Half of the range of the latency.
    double stall_every_s = 0.0;  ///< Interval of stalls; 0: never.
    double stall_s = 0.0;        ///< Duration of a stall.
    double cut_every_s = 0.0;    ///< Interval at which the connection is closed; 0: never.
  };

  LinkProxy(std::uint16_t server_port, const Link& link, std::uint64_t seed)
      : link_(link), server_port_(server_port), random_(seed), listener_(Socket()) {
    sockaddr_in address = Loopback(0);
    socklen_t bytes = sizeof address;
    if (::bind(listener_, Generic(address), bytes) != 0 || ::listen(listener_, 8) != 0 ||
        ::getsockname(listener_, Generic(address), &bytes) != 0) {
      return;
    }
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { Run(); });
  }
  ~LinkProxy() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    Close();
    ::close(listener_);
  }
  LinkProxy(const LinkProxy&) = delete;
  LinkProxy& operator=(const LinkProxy&) = delete;

  /// 0 if the proxy could not be started.
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] int cuts() const { return cuts_; }
  [[nodiscard]] int stalls() const { return stalls_; }

 private:
  struct Chunk {
    double due_s = 0.0;
    std::vector<std::byte> bytes;
  };
  struct Direction {
    int from = -1;
    int to = -1;
    std::deque<Chunk> chunks;
    double last_due_s = 0.0;
  };

  static sockaddr* Generic(sockaddr_in& address) { return reinterpret_cast<sockaddr*>(&address); }
  static sockaddr_in Loopback(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
  }
  static int Socket() { return ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0); }

  [[nodiscard]] double Now() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

  void Run() {
    while (!stop_) {
      const double now_s = Now();
      const bool stalled = link_.stall_every_s > 0.0 && std::fmod(now_s, link_.stall_every_s) >
                                                            link_.stall_every_s - link_.stall_s;
      if (stalled && !was_stalled_) ++stalls_;
      was_stalled_ = stalled;
      if (link_.cut_every_s > 0.0 && now_s > next_cut_s_) {
        next_cut_s_ = now_s + link_.cut_every_s;
        if (directions_[0].from >= 0) ++cuts_;
        Close();
      }
      if (directions_[0].from < 0) {
        Accept();
      } else {
        bool open = true;
        for (Direction& direction : directions_) open = open && Receive(direction, now_s);
        for (Direction& direction : directions_) open = open && Send(direction, now_s, stalled);
        if (!open) Close();
      }
    }
  }

  void Accept() {
    pollfd waiting{listener_, POLLIN, 0};
    if (::poll(&waiting, 1, 1) <= 0) return;
    const int client = ::accept(listener_, nullptr, nullptr);
    const int server = Socket();
    sockaddr_in address = Loopback(server_port_);
    if (client < 0 || ::connect(server, Generic(address), sizeof address) != 0) {
      ::close(client);
      ::close(server);
      return;
    }
    const int on = 1;
    for (const int socket : {client, server}) {
      ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    }
    directions_[0] = {client, server, {}, 0.0};
    directions_[1] = {server, client, {}, 0.0};
  }

  bool Receive(Direction& direction, double now_s) {
    std::vector<std::byte> bytes(std::size_t{1} << 16);
    pollfd waiting{direction.from, POLLIN, 0};
    if (::poll(&waiting, 1, direction.from == directions_[1].from ? 1 : 0) <= 0) return true;
    const auto count = ::recv(direction.from, bytes.data(), bytes.size(), 0);
    if (count <= 0) return false;
    bytes.resize(static_cast<std::size_t>(count));
    std::uniform_real_distribution<double> delay_s(link_.latency_s - link_.jitter_s,
                                                   link_.latency_s + link_.jitter_s);
    direction.last_due_s = std::max(direction.last_due_s, now_s + delay_s(random_));
    direction.chunks.push_back({direction.last_due_s, std::move(bytes)});
    return true;
  }

  static bool Send(Direction& direction, double now_s, bool stalled) {
    while (!stalled && !direction.chunks.empty() && direction.chunks.front().due_s <= now_s) {
      const std::vector<std::byte>& bytes = direction.chunks.front().bytes;
      std::size_t sent = 0;
      while (sent < bytes.size()) {
        const auto count =
            ::send(direction.to, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
        if (count <= 0) return false;
        sent += static_cast<std::size_t>(count);
      }
      direction.chunks.pop_front();
    }
    return true;
  }

  void Close() {
    if (directions_[0].from < 0) return;
    ::close(directions_[0].from);
    ::close(directions_[0].to);
    directions_[0] = directions_[1] = Direction();
  }

  Link link_;
  std::uint16_t server_port_;
  std::mt19937_64 random_;
  int listener_;
  std::uint16_t port_ = 0;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::array<Direction, 2> directions_;  ///< From the client to the server, and back.
  double next_cut_s_ = link_.cut_every_s;
  bool was_stalled_ = false;
  std::atomic<int> cuts_ = 0;
  std::atomic<int> stalls_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace stridewire::test
