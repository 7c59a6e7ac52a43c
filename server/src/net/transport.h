#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "net/shared_frame.h"
#include "ops/metrics.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

enum class TransportKind : std::uint8_t { kTcp, kWebSocket };

/// Why a WebSocket ends (RFC 6455, Section 7.4.1); plain TCP has no place for it.
enum class CloseCode : std::uint16_t {
  kNormal = 1000,
  kGoingAway = 1001,
  kProtocolError = 1002,
  kNotBinary = 1003,
  kPolicy = 1008,
  kTooBig = 1009,
  kTryAgainLater = 1013,
};

/// What passes a connection, byte by byte as the system gives and takes it.
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
  /// Something is about to be sent: from now on the peer may be slow.
  void BeginToSend() { last_sent_ = Clock::now(); }
  void ProtocolError() { metrics_.protocol_errors.Add(); }

  [[nodiscard]] Clock::time_point last_received() const { return last_received_; }
  [[nodiscard]] Clock::time_point last_sent() const { return last_sent_; }

 private:
  ThreadMetrics& metrics_;
  Clock::time_point last_received_ = Clock::now();
  Clock::time_point last_sent_ = last_received_;
};

/// How frames of one connection travel: over plain TCP, one behind the other, or each as one binary
/// message of a WebSocket. One socket, on one thread at a time; at most one Receive and one Send
/// are under way. Virtual calls are a read or a write, not a frame or a byte.
class Transport {
 public:
  /// Bytes that came. Where there are messages, all of them are of one.
  struct Chunk {
    std::span<const std::byte> bytes;
    bool ends_message = false;
    bool is_text = false;  ///< The message is no binary one.
  };

  /// Who is told what came of it. Kept alive as long as something is under way.
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
  /// Are there messages, each of which is one frame?
  [[nodiscard]] bool has_messages() const { return kind() == TransportKind::kWebSocket; }
  [[nodiscard]] virtual boost::asio::any_io_executor executor() = 0;

  /// Before anything is received or sent, and again after a move. `traffic` lives as long as the
  /// user; a buffer size of 0 is the system's choice.
  virtual void Prepare(Traffic& traffic, std::size_t send_buffer_bytes) = 0;

  /// Receives some bytes into `buffer`, which is the user's.
  virtual void Receive(std::shared_ptr<User> user, std::span<std::byte> buffer) = 0;
  /// Sends all of `frames`, which the user keeps. True: that is done, and nobody is told.
  [[nodiscard]] virtual bool Send(std::shared_ptr<User> user,
                                  std::span<const SharedFrame> frames) = 0;

  /// Tells the peer that nothing more comes. After the last Send; the user goes on receiving until
  /// the peer has closed, too. An error: there is nobody to tell.
  [[nodiscard]] virtual bool End(std::shared_ptr<User> user, CloseCode code) = 0;
  /// At once.
  virtual void Close() = 0;

  // Moving to another thread's io_context, when nothing is under way.
  virtual void Detach() = 0;
  [[nodiscard]] virtual bool Attach(boost::asio::io_context& context) = 0;
};

}  // namespace stridewire::server
