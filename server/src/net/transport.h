#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/metrics.h"
#include "net/shared_frame.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

enum class TransportKind : std::uint8_t { kTcp, kWebSocket };

/// Status code of a WebSocket close frame (RFC 6455, Section 7.4.1). Plain TCP does not send it.
enum class CloseCode : std::uint16_t {
  kNormal = 1000,
  kGoingAway = 1001,
  kProtocolError = 1002,
  kNotBinary = 1003,
  kPolicy = 1008,
  kTooBig = 1009,
  kTryAgainLater = 1013,
};

/// A buffer sequence that borrows its buffers. Asio copies buffer sequences, and copying a vector
/// would allocate memory for every write.
struct BufferList {
  // These names are required by Asio.
  using value_type = boost::asio::const_buffer;             // NOLINT(readability-identifier-naming)
  using const_iterator = const boost::asio::const_buffer*;  // NOLINT(readability-identifier-naming)
  const_iterator first;
  const_iterator last;
  [[nodiscard]] const_iterator begin() const { return first; }
  [[nodiscard]] const_iterator end() const { return last; }
};

/// Counts the bytes of one connection and records when the last bytes were received and sent.
class Traffic {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Traffic(ThreadMetrics& metrics) : metrics_(metrics) {}

  void Received(std::size_t bytes) {
    metrics_.bytes_received.Add(bytes);
    last_received_ = Clock::now();
  }
  void Sent(std::size_t bytes) {
    metrics_.bytes_sent.Add(bytes);
    last_sent_ = Clock::now();
  }
  /// Restarts the write timeout before a write.
  void BeginToSend() { last_sent_ = Clock::now(); }
  void ProtocolError() { metrics_.protocol_errors.Add(); }

  [[nodiscard]] Clock::time_point last_received() const { return last_received_; }
  [[nodiscard]] Clock::time_point last_sent() const { return last_sent_; }

 private:
  ThreadMetrics& metrics_;
  Clock::time_point last_received_ = Clock::now();
  Clock::time_point last_sent_ = last_received_;
};

/// Carries the frames of one connection: one after the other over plain TCP, or in binary messages
/// of a WebSocket. A transport owns one socket and is used by one thread at a time. At most
/// one Receive and one Send may be pending. There is one virtual call per read or write, not per
/// frame.
class Transport {
 public:
  /// Received bytes. Over WebSocket, they belong to one message.
  struct Chunk {
    std::span<const std::byte> bytes;
    bool ends_message = false;
    bool is_text = false;  ///< True if the bytes belong to a text message.
  };

  /// Receives the results of operations. A pending operation keeps its user alive.
  class User {
   public:
    virtual ~User() = default;
    virtual void OnReceived(const boost::system::error_code& error, const Chunk& chunk) = 0;
    virtual void OnSent(const boost::system::error_code& error) = 0;
  };

  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  virtual ~Transport() = default;

  [[nodiscard]] virtual TransportKind kind() const = 0;
  /// True if the transport has message boundaries. Each received message must then contain one
  /// frame.
  [[nodiscard]] bool has_messages() const { return kind() == TransportKind::kWebSocket; }
  [[nodiscard]] virtual boost::asio::any_io_executor executor() = 0;

  /// Must be called before the first operation and again after Attach. `traffic` must outlive the
  /// operations. If `send_buffer_bytes` is 0, the system chooses the size.
  virtual void Prepare(Traffic& traffic, std::size_t send_buffer_bytes) = 0;

  /// Receives some bytes into `buffer`, which the user owns. Calls OnReceived later.
  virtual void Receive(std::shared_ptr<User> user, std::span<std::byte> buffer) = 0;
  /// Sends all `frames`, which the user keeps alive. The last `joined_frames` of them may share a
  /// message. Returns true if they were sent at once; otherwise calls OnSent later.
  [[nodiscard]] virtual bool Send(std::shared_ptr<User> user, std::span<const SharedFrame> frames,
                                  std::size_t joined_frames) = 0;

  /// Sends a ping, if the transport has pings. The WebSocket implementation of the peer answers it,
  /// not its application. The answer counts as received bytes.
  virtual void KeepAlive(std::shared_ptr<User> user) = 0;

  /// Closes the sending direction after the last Send. The user continues to receive until the peer
  /// has closed, too. Returns false if the socket is already broken.
  [[nodiscard]] virtual bool End(std::shared_ptr<User> user, CloseCode code) = 0;
  /// Closes the socket at once. Pending operations fail, some of them before Close returns.
  virtual void Close() = 0;

  // Detach and Attach move the transport to the io_context of another thread. No operation may be
  // pending. Attach returns false if the socket is no longer usable.
  virtual void Detach() = 0;
  [[nodiscard]] virtual bool Attach(boost::asio::io_context& context) = 0;
};

}  // namespace stridewire::server
