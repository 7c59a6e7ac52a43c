#include "fake_server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <utility>

#include "stridewire/protocol/decode.h"

namespace stridewire {

namespace {

bool WaitReadable(int fd) {
  pollfd p{fd, POLLIN, 0};
  return poll(&p, 1, static_cast<int>(FakeServer::kPatienceS * 1000.0)) == 1;
}

}  // namespace

FakeConnection::FakeConnection(FakeConnection&& other) noexcept { *this = std::move(other); }

FakeConnection& FakeConnection::operator=(FakeConnection&& other) noexcept {
  std::swap(fd_, other.fd_);
  std::swap(encoder_, other.encoder_);
  std::swap(reader_, other.reader_);
  std::swap(input_, other.input_);
  std::swap(taken_, other.taken_);
  std::swap(mute_pongs, other.mute_pongs);
  std::swap(pings, other.pings);
  return *this;
}

void FakeConnection::SendBytes(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return;
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
}

std::optional<protocol::Message> FakeConnection::Receive() {
  for (;;) {
    auto rest = std::span<const std::byte>(input_).subspan(taken_);
    auto frame = reader_.Next(rest);
    taken_ = input_.size() - rest.size();
    if (!frame) return std::nullopt;
    if (*frame) {
      auto message = protocol::DecodeMessage(**frame);
      if (!message) return std::nullopt;
      const auto* ping = std::get_if<protocol::Ping>(&*message);
      if (ping == nullptr) return std::move(*message);
      ++pings;
      if (!mute_pongs) Send(protocol::Pong{ping->nonce, ping->time_s, 0.0, 0});
      continue;
    }
    if (fd_ < 0 || !WaitReadable(fd_)) return std::nullopt;
    input_.resize(65'536);
    const ssize_t got = recv(fd_, input_.data(), input_.size(), 0);
    if (got <= 0) return std::nullopt;
    input_.resize(static_cast<std::size_t>(got));
    taken_ = 0;
  }
}

bool FakeConnection::WaitForClose() {
  std::byte scratch[4096];
  while (WaitReadable(fd_)) {
    if (recv(fd_, scratch, sizeof scratch, 0) <= 0) return true;
  }
  return false;
}

void FakeConnection::Close() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

FakeServer::FakeServer(std::uint16_t port) {
  fd_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int one = 1;
  setsockopt(fd_, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  socklen_t length = sizeof address;
  if (bind(fd_, reinterpret_cast<const sockaddr*>(&address), length) != 0 || listen(fd_, 16) != 0 ||
      getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &length) != 0) {
    return;  // port() then returns 0, and the test cannot connect.
  }
  port_ = ntohs(address.sin_port);
}

FakeServer::~FakeServer() {
  if (fd_ >= 0) close(fd_);
}

FakeConnection FakeServer::Accept() {
  if (!WaitReadable(fd_)) return {};
  const int fd = accept(fd_, nullptr, nullptr);
  const int one = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
  return FakeConnection(fd);
}

}  // namespace stridewire
