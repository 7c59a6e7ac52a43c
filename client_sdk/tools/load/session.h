#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/frame_reader.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::load {

/// Returns the current time of the steady clock in nanoseconds.
[[nodiscard]] inline std::int64_t NowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

inline constexpr std::int64_t kSecondNs = 1'000'000'000;

/// Resources that all sessions of a thread share, so that a session takes little memory.
struct ThreadContext {
  boost::asio::io_context io{1};
  protocol::Encoder encoder;
  std::vector<std::uint64_t> read_buffer =
      std::vector<std::uint64_t>(32'768);  ///< 256 KiB, aligned
};

/// A client session over TCP. It connects, sends Hello and pings, and numbers commands. After a
/// lost connection it starts a new session; it never resumes one.
///
///   kNew --Open--> kConnecting --> kGreeting --Welcome--> kReady --Finish--> kFinished
///                       ^              |                     |
///                       |         Lose, Drop            Lose, Drop
///                       +---- kWaiting <---------------------+
///
/// All calls must be on the thread of its ThreadContext, which calls `Poll` about ten times per
/// second.
class Session {
 public:
  static constexpr std::size_t kMaxWaitingBytes = std::size_t{16}
                                                  << 20;  ///< Maximum number of unsent bytes.
  /// Maximum time from the attempt to connect to Welcome.
  static constexpr double kConnectTimeoutS = 5.0;

  Session(ThreadContext& context, boost::asio::ip::tcp::endpoint server, std::string name);
  virtual ~Session() = default;
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Connects to the server.
  void Open();

  /// Sends Goodbye if ready, and closes the connection permanently.
  void Finish();

  /// Ends the session and connects again after `pause_s`.
  void Drop(double pause_s);

  /// Handles timeouts, pings and reconnects.
  void Poll(std::int64_t now_ns);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool finished() const { return state_ == State::kFinished; }
  [[nodiscard]] std::uint64_t reconnect_count() const { return reconnect_count_; }

 protected:
  /// Sends a message. Closes the connection if the message cannot be encoded or if too many bytes
  /// are unsent.
  template <typename M>
  void Send(const M& message) {
    if (!connected()) return;
    const Status encoded = context_.encoder.Encode(message, waiting_);
    if (!encoded) return Lose("cannot encode a message: " + Describe(encoded.error()));
    if (waiting_.size() > kMaxWaitingBytes) return Lose("the server reads too slowly");
    Write();
  }

  [[nodiscard]] protocol::Seq NextSeq() { return next_seq_++; }
  [[nodiscard]] const protocol::Welcome& welcome() const { return welcome_; }
  [[nodiscard]] ThreadContext& context() { return context_; }

  /// Called when a new session has begun. No world is joined yet.
  virtual void OnWelcome() = 0;
  /// Handles every message except Welcome, Pong, Goodbye and fatal errors. `frame_bytes` includes
  /// the header.
  virtual void OnMessage(protocol::Message& message, std::size_t frame_bytes,
                         std::int64_t now_ns) = 0;
  /// Called when the connection was lost or could not be established. `by_us` is true if Drop was
  /// the cause. The session reconnects. Failed attempts to reconnect cause no further calls.
  virtual void OnLost(const std::string& why, bool by_us) = 0;

  /// Closes the connection because of an error and reconnects later.
  void Lose(const std::string& why);

 private:
  enum class State { kNew, kConnecting, kGreeting, kReady, kWaiting, kFinished };

  [[nodiscard]] bool connected() const {
    return state_ == State::kGreeting || state_ == State::kReady;
  }
  void SendGoodbye();
  void Close();
  void WaitToRead();
  void Read();
  void Handle(const protocol::FrameView& frame);
  void Write();
  void OnWritten(const boost::system::error_code& failed);

  ThreadContext& context_;
  const boost::asio::ip::tcp::endpoint server_;
  const std::string name_;
  State state_ = State::kNew;
  /// Number of the connection. Handlers of earlier connections compare it with their own and then
  /// do nothing.
  std::uint64_t connection_ = 0;
  std::optional<boost::asio::ip::tcp::socket> socket_;
  std::optional<protocol::FrameReader> reader_;
  std::vector<std::byte> waiting_;
  std::vector<std::byte> writing_;
  std::size_t written_ = 0;
  protocol::Welcome welcome_;
  protocol::Seq next_seq_ = 1;
  std::uint64_t next_nonce_ = 1;
  std::int64_t deadline_ns_ = 0;  ///< Time of the timeout, or of the next attempt.
  std::int64_t received_ns_ = 0;
  std::int64_t sent_ns_ = 0;
  double back_off_s_ = 0.0;
  std::uint64_t reconnect_count_ = 0;
  bool was_ready_ = false;
  bool is_loss_reported_ = false;
};

}  // namespace stridewire::load
