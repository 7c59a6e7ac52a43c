#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/frame_reader.h"
#include "stridewire/protocol/messages.h"

/// A scripted server for tests of clients, over a real socket on 127.0.0.1. Its calls block for at
/// most kPatienceS, and it has no threads.
namespace stridewire {

class FakeConnection {
 public:
  FakeConnection() = default;
  explicit FakeConnection(int fd) : fd_(fd) {}
  ~FakeConnection() { Close(); }
  FakeConnection(FakeConnection&& other) noexcept;
  FakeConnection& operator=(FakeConnection&& other) noexcept;

  [[nodiscard]] bool is_open() const { return fd_ >= 0; }

  template <typename Message>
  void Send(const Message& message) {
    std::vector<std::byte> frame;
    if (encoder_.Encode(message, frame)) SendBytes(frame);
  }
  void SendBytes(std::span<const std::byte> bytes);

  /// Returns the next message that is not a Ping. Pings are counted, and answered unless
  /// `mute_pongs` is set. Returns nullopt after a timeout or if the client has closed.
  [[nodiscard]] std::optional<protocol::Message> Receive();

  /// Returns the next message if it has this type, otherwise nullopt.
  template <typename Message>
  [[nodiscard]] std::optional<Message> Expect() {
    auto message = Receive();
    if (!message || !std::holds_alternative<Message>(*message)) return std::nullopt;
    return std::get<Message>(std::move(*message));
  }

  /// Returns true if the client closes in time. Discards messages that it still sends.
  [[nodiscard]] bool WaitForClose();

  void Close();

  bool mute_pongs = false;
  int pings = 0;

 private:
  int fd_ = -1;
  protocol::Encoder encoder_;
  protocol::FrameReader reader_{protocol::Sender::kClient};
  std::vector<std::byte> input_;
  std::size_t taken_ = 0;
};

class FakeServer {
 public:
  static constexpr double kPatienceS = 20.0;

  /// Listens on `port`; 0: the system chooses a port.
  explicit FakeServer(std::uint16_t port = 0);
  ~FakeServer();
  FakeServer(const FakeServer&) = delete;
  FakeServer& operator=(const FakeServer&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }

  /// Returns the next connection. It is not open if no client connects in time.
  [[nodiscard]] FakeConnection Accept();

 private:
  int fd_ = -1;
  std::uint16_t port_ = 0;
};

}  // namespace stridewire
