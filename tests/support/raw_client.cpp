#include "raw_client.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "stridewire/protocol/decode.h"

namespace stridewire {
namespace {

[[noreturn]] void Die(const char* what) {
  std::perror(what);
  std::abort();
}

}  // namespace

RawClient::RawClient(const std::string& host, std::uint16_t port, int receive_buffer_bytes) {
  socket_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (socket_ < 0) Die("socket");
  if (receive_buffer_bytes > 0) {
    setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof(int));
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  if (inet_pton(AF_INET, host.c_str(), &address.sin_addr) != 1) Die("inet_pton");
  if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    Die("connect");
  }
}

RawClient::~RawClient() {
  if (socket_ >= 0) close(socket_);
}

RawClient::RawClient(RawClient&& other) noexcept { *this = std::move(other); }

RawClient& RawClient::operator=(RawClient&& other) noexcept {
  if (socket_ >= 0) close(socket_);
  socket_ = std::exchange(other.socket_, -1);
  is_closed_ = other.is_closed_;
  encoder_ = std::move(other.encoder_);
  reader_ = std::move(other.reader_);
  buffer_ = std::move(other.buffer_);
  unread_ = other.unread_;
  last_seq_ = other.last_seq_;
  return *this;
}

void RawClient::Abort() {
  // Reset the connection instead of closing it gracefully.
  const linger hard{1, 0};
  setsockopt(socket_, SOL_SOCKET, SO_LINGER, &hard, sizeof(hard));
  close(std::exchange(socket_, -1));
  is_closed_ = true;
}

void RawClient::RequireEncoded(const Status& status) {
  if (status) return;
  std::fprintf(stderr, "a test's message could not be encoded: %s\n",
               Describe(status.error()).c_str());
  std::abort();
}

void RawClient::SendBytes(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) {  // The server has closed. Data that has arrived can still be read.
      return;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
}

bool RawClient::WaitReadable(std::chrono::steady_clock::time_point until) const {
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        until - std::chrono::steady_clock::now());
    if (left.count() <= 0) return false;
    pollfd waiting{socket_, POLLIN, 0};
    const int ready = poll(&waiting, 1, static_cast<int>(left.count()) + 1);
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return false;
  }
}

std::optional<protocol::Message> RawClient::Receive(std::chrono::milliseconds patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  for (;;) {
    auto next = reader_.Next(unread_);
    if (!next) {
      std::fprintf(stderr, "the server sent no frame: %s\n", Describe(next.error()).c_str());
      std::abort();
    }
    if (next->has_value()) {
      auto message = protocol::DecodeMessage(**next);
      if (message) return *std::move(message);
      std::fprintf(stderr, "the server sent no message: %s\n", Describe(message.error()).c_str());
      std::abort();
    }
    if (is_closed_ || !WaitReadable(until)) return std::nullopt;
    const ssize_t got = recv(socket_, buffer_.data(), buffer_.size(), 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      is_closed_ = true;
      return std::nullopt;
    }
    unread_ = std::span(buffer_).first(static_cast<std::size_t>(got));
  }
}

bool RawClient::AwaitClose(std::chrono::milliseconds patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  while (!is_closed_ && std::chrono::steady_clock::now() < until) {
    static_cast<void>(Receive(std::chrono::duration_cast<std::chrono::milliseconds>(
        until - std::chrono::steady_clock::now())));
  }
  return is_closed_;
}

std::optional<protocol::Welcome> RawClient::SayHello(std::vector<std::byte> resume_token,
                                                     std::uint64_t last_events_number) {
  Send(protocol::Hello{.client_name = "test",
                       .auth_token = {},
                       .resume_token = std::move(resume_token),
                       .last_events_number = last_events_number});
  return Await<protocol::Welcome>();
}

std::optional<protocol::WorldInfo> RawClient::Join(const std::string& world, protocol::Role role) {
  Send(protocol::JoinWorld{.seq = NextSeq(), .name = world, .role = role});
  auto info = Await<protocol::WorldInfo>();
  if (!info || !Await<protocol::Reply>()) return std::nullopt;
  return info;
}

std::optional<protocol::Reply> RawClient::Spawn(protocol::WorldId world,
                                                std::vector<protocol::SpawnItem> items) {
  Send(protocol::Spawn{.seq = NextSeq(), .world = world, .items = std::move(items)});
  return Await<protocol::Reply>();
}

std::optional<protocol::Reply> RawClient::Request(protocol::WorldId world,
                                                  std::vector<protocol::RequestItem> items) {
  Send(protocol::Request{.seq = NextSeq(), .world = world, .items = std::move(items)});
  return Await<protocol::Reply>();
}

std::optional<protocol::Reply> RawClient::Observe(protocol::WorldId world,
                                                  protocol::SubscriptionId id,
                                                  protocol::PoseMode mode, bool with_events,
                                                  std::uint16_t every_n_ticks) {
  Send(protocol::Observe{.seq = NextSeq(),
                         .world = world,
                         .subscription = id,
                         .mode = mode,
                         .avatars = {},
                         .every_n_ticks = every_n_ticks,
                         .with_events = with_events});
  return Await<protocol::Reply>();
}

std::vector<protocol::RequestItem> Steps(protocol::AvatarId avatar, int count, double length_m) {
  std::vector<protocol::RequestItem> items;
  for (int i = 1; i <= count; ++i) {
    items.push_back({.avatar = avatar,
                     .request_id = static_cast<protocol::RequestId>(i),
                     .movement = protocol::StepMovement{.length_m = length_m}});
  }
  return items;
}

}  // namespace stridewire
