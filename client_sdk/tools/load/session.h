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

/// The one clock of a run.
[[nodiscard]] inline std::int64_t NowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

inline constexpr std::int64_t kSecondNs = 1'000'000'000;

/// What the sessions of one thread share, so that each of thousands stays small.
struct ThreadContext {
  boost::asio::io_context io{1};
  protocol::Encoder encoder;
  std::vector<std::uint64_t> read_buffer =
      std::vector<std::uint64_t>(32'768);  ///< 256 KiB, aligned
};

/// One client session over TCP, straight on the protocol library: connects, greets, keeps alive,
/// numbers commands, and comes back with a new session when the connection is lost. It never asks
/// for an old session (resume): a simulated client that lost its connection begins anew.
///
/// Lives on one thread (its ThreadContext's); `Poll` is called there about ten times a second.
class Session {
 public:
  static constexpr std::size_t kMaxWaitingBytes = std::size_t{16} << 20;  ///< To be sent.
  static constexpr double kConnectTimeoutS = 5.0;  ///< From connecting to Welcome.

  Session(ThreadContext& context, boost::asio::ip::tcp::endpoint server, std::string name);
  virtual ~Session() = default;
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  void Open();

  /// Says Goodbye, if it is greeted, and closes; does not come back.
  void Finish();

  /// Drops the connection without a word and comes back after `pause_s`.
  void Drop(double pause_s);

  /// Timeouts, pings, coming back.
  void Poll(std::int64_t now_ns);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool finished() const { return state_ == State::kFinished; }
  [[nodiscard]] std::uint64_t reconnect_count() const { return reconnect_count_; }
  /// Whether everything given to Send has gone to the system.
  [[nodiscard]] bool all_sent() const { return writing_.empty() && waiting_.empty(); }

 protected:
  /// Sends a message. One that cannot be encoded or would wait in too long a line ends the
  /// connection, as Lost tells.
  template <typename M>
  void Send(const M& message) {
    if (!connected()) return;
    const Status encoded = context_.encoder.Encode(message, waiting_);
    if (!encoded) return Lose("could not encode a message: " + Describe(encoded.error()));
    if (waiting_.size() > kMaxWaitingBytes) return Lose("the server does not read what it is sent");
    Write();
  }

  [[nodiscard]] protocol::Seq NextSeq() { return next_seq_++; }
  [[nodiscard]] const protocol::Welcome& welcome() const { return welcome_; }
  [[nodiscard]] ThreadContext& context() { return context_; }

  /// Greeted: a new session has begun, nothing is joined.
  virtual void OnWelcome() = 0;
  /// Any message but Welcome, Pong, Goodbye and a fatal Error. `frame_bytes` counts the header, too.
  virtual void OnMessage(protocol::Message& message, std::size_t frame_bytes,
                         std::int64_t now_ns) = 0;
  /// The connection is gone, or there never was one; by_us: Drop. It comes back by itself; what
  /// fails on the way back is not told again.
  virtual void OnLost(const std::string& why, bool by_us) = 0;

  /// Ends the connection because of something the server did; comes back.
  void Lose(const std::string& why);

 private:
  enum class State { kNew, kConnecting, kGreeting, kReady, kWaiting, kFinished };

  [[nodiscard]] bool connected() const {
    return state_ == State::kGreeting || state_ == State::kReady;
  }
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
  /// Counts connections, so that what is left over from an old one is recognised and ignored.
  std::uint64_t connection_ = 0;
  std::optional<boost::asio::ip::tcp::socket> socket_;
  std::optional<protocol::FrameReader> reader_;
  std::vector<std::byte> waiting_;
  std::vector<std::byte> writing_;
  std::size_t written_ = 0;
  protocol::Welcome welcome_;
  protocol::Seq next_seq_ = 1;
  std::uint64_t next_nonce_ = 1;
  std::int64_t deadline_ns_ = 0;  ///< kConnecting, kGreeting: give up; kWaiting: try again
  std::int64_t heard_ns_ = 0;
  std::int64_t sent_ns_ = 0;
  double back_off_s_ = 0.0;
  std::uint64_t reconnect_count_ = 0;
  bool was_ready_ = false;
  bool is_loss_told_ = false;
};

}  // namespace stridewire::load
