#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/frame_reader.h"
#include "stridewire/protocol/messages.h"

namespace stridewire {

/// A client with blocking calls over a plain socket, for tests of the server. It sends valid and
/// invalid messages and returns the received ones. Every wait is limited to `kPatience`.
class RawClient {
 public:
  static constexpr std::chrono::seconds kPatience{20};

  RawClient() = default;
  /// Connects. Aborts the program on failure.
  RawClient(const std::string& host, std::uint16_t port, int receive_buffer_bytes = 0);
  virtual ~RawClient();
  RawClient(RawClient&& other) noexcept;
  RawClient& operator=(RawClient&& other) noexcept;

  virtual void SendBytes(std::span<const std::byte> bytes);
  template <typename Message>
  void Send(const Message& message) {
    std::vector<std::byte> frame;
    RequireEncoded(encoder_.Encode(message, frame));
    SendBytes(frame);
  }

  /// Returns the next message, or nullopt if the server has closed or after `patience`. A PoseBatch
  /// is valid until the next call.
  [[nodiscard]] virtual std::optional<protocol::Message> Receive(
      std::chrono::milliseconds patience = kPatience);

  /// Returns the next message of a type. Messages before it are passed to `on_other` or dropped.
  template <typename Message>
  [[nodiscard]] std::optional<Message> Await(
      const std::function<void(const protocol::Message&)>& on_other = nullptr) {
    while (auto message = Receive()) {
      if (auto* wanted = std::get_if<Message>(&*message)) return std::move(*wanted);
      if (on_other) on_other(*message);
    }
    return std::nullopt;
  }

  /// Reads until the server closes the connection. Returns false if it does not within `patience`.
  [[nodiscard]] bool AwaitClose(std::chrono::milliseconds patience = kPatience);

  /// Resets the connection, like a failed network.
  virtual void Abort();
  [[nodiscard]] bool is_closed() const { return is_closed_; }

  // Common exchanges: each sends one message and waits for its answer.
  std::optional<protocol::Welcome> SayHello(std::vector<std::byte> resume_token = {},
                                            std::uint64_t last_events_number = 0);
  std::optional<protocol::WorldInfo> Join(const std::string& world,
                                          protocol::Role role = protocol::Role::kController);
  std::optional<protocol::Reply> Spawn(protocol::WorldId world,
                                       std::vector<protocol::SpawnItem> items);
  std::optional<protocol::Reply> Request(protocol::WorldId world,
                                         std::vector<protocol::RequestItem> items);
  std::optional<protocol::Reply> Observe(protocol::WorldId world, protocol::SubscriptionId id,
                                         protocol::PoseMode mode, bool with_events = false,
                                         std::uint16_t every_n_ticks = 1);
  protocol::Seq NextSeq() { return ++last_seq_; }
  void set_last_seq(protocol::Seq seq) { last_seq_ = seq; }

 protected:
  void set_closed() { is_closed_ = true; }

 private:
  static void RequireEncoded(const Status& status);
  bool WaitReadable(std::chrono::steady_clock::time_point until) const;

  int socket_ = -1;
  bool is_closed_ = false;
  protocol::Encoder encoder_;
  protocol::FrameReader reader_{protocol::Sender::kServer};
  std::vector<std::byte> buffer_ = std::vector<std::byte>(std::size_t{256} << 10);
  std::span<const std::byte> unread_;
  protocol::Seq last_seq_ = 0;
};

/// Returns `count` step requests of one avatar, with request ids from 1.
[[nodiscard]] std::vector<protocol::RequestItem> Steps(protocol::AvatarId avatar, int count,
                                                       double length_m);

}  // namespace stridewire
