#include "session.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <utility>

#include "stridewire/protocol/decode.h"

namespace stridewire::load {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

constexpr double kFirstBackOffS = 0.1;
constexpr double kMaxBackOffS = 2.0;
/// Number of bytes to read from a socket before other sockets are served.
constexpr std::size_t kMaxReadAtOnce = std::size_t{128} << 10;

std::int64_t ToNs(double seconds) { return static_cast<std::int64_t>(seconds * 1e9); }

}  // namespace

Session::Session(ThreadContext& context, tcp::endpoint server, std::string name)
    : context_(context), server_(std::move(server)), name_(std::move(name)) {}

void Session::Open() {
  if (state_ == State::kFinished) return;
  ++connection_;
  state_ = State::kConnecting;
  deadline_ns_ = NowNs() + ToNs(kConnectTimeoutS);
  reader_.emplace(protocol::Sender::kServer);
  waiting_.clear();
  writing_.clear();
  written_ = 0;
  socket_.emplace(context_.io);
  socket_->async_connect(server_, [this, id = connection_](const boost::system::error_code& code) {
    if (id != connection_ || state_ != State::kConnecting) return;
    if (code) return Lose("cannot connect: " + code.message());
    boost::system::error_code ignored;
    (void)socket_->set_option(tcp::no_delay(true), ignored);
    boost::system::error_code failed;
    (void)socket_->non_blocking(true, failed);
    if (failed) return Lose(failed.message());
    state_ = State::kGreeting;
    protocol::Hello hello;
    hello.client_name = name_;
    WaitToRead();
    Send(hello);
  });
}

void Session::SendGoodbye() {
  if (state_ != State::kReady || !writing_.empty()) return;
  if (!context_.encoder.Encode(protocol::Goodbye{}, waiting_)) return;
  // An error is ignored, because the session does not wait until the Goodbye is sent.
  boost::system::error_code ignored;
  socket_->write_some(asio::buffer(waiting_), ignored);
}

void Session::Finish() {
  if (state_ == State::kFinished) return;
  SendGoodbye();
  Close();
  state_ = State::kFinished;
}

void Session::Drop(double pause_s) {
  if (state_ == State::kFinished || state_ == State::kWaiting) return;
  SendGoodbye();
  Close();
  state_ = State::kWaiting;
  back_off_s_ = 0.0;
  deadline_ns_ = NowNs() + ToNs(pause_s);
  OnLost("dropped", true);
}

void Session::Lose(const std::string& why) {
  if (state_ == State::kFinished || state_ == State::kWaiting || state_ == State::kNew) return;
  Close();
  state_ = State::kWaiting;
  back_off_s_ = std::clamp(2.0 * back_off_s_, kFirstBackOffS, kMaxBackOffS);
  deadline_ns_ = NowNs() + ToNs(back_off_s_);
  // A loss is reported once. Failed attempts to reconnect are not reported.
  if (!std::exchange(is_loss_reported_, true)) OnLost(why, false);
}

void Session::Close() {
  ++connection_;  // From now on, pending handlers of the old connection do nothing.
  if (socket_) {
    boost::system::error_code ignored;
    (void)socket_->close(ignored);
  }
}

void Session::Poll(std::int64_t now_ns) {
  switch (state_) {
    case State::kNew:
    case State::kFinished: return;
    case State::kWaiting:
      if (now_ns >= deadline_ns_) Open();
      return;
    case State::kConnecting:
    case State::kGreeting:
      if (now_ns >= deadline_ns_) Lose("the server did not answer within 5 s");
      return;
    case State::kReady: break;
  }
  const std::int64_t idle_ns = ToNs(welcome_.limits.idle_timeout_s);
  if (idle_ns <= 0) return;
  if (now_ns - received_ns_ > idle_ns) return Lose("the server sent nothing for too long");
  if (now_ns - sent_ns_ > idle_ns / 3) {
    Send(protocol::Ping{.nonce = next_nonce_++, .time_s = 1e-9 * static_cast<double>(now_ns)});
  }
}

void Session::WaitToRead() {
  // Waiting for readability needs no buffer, so an idle session takes little memory.
  socket_->async_wait(tcp::socket::wait_read,
                      [this, id = connection_](const boost::system::error_code& code) {
                        if (id != connection_) return;
                        if (code) return Lose("connection lost: " + code.message());
                        Read();
                      });
}

void Session::Read() {
  const std::span<std::byte> buffer = std::as_writable_bytes(std::span(context_.read_buffer));
  std::size_t taken = 0;
  while (taken < kMaxReadAtOnce) {
    boost::system::error_code code;
    const std::size_t size = socket_->read_some(asio::buffer(buffer.data(), buffer.size()), code);
    if (code == asio::error::would_block || code == asio::error::try_again) break;
    if (code) return Lose("connection lost: " + code.message());
    taken += size;
    received_ns_ = NowNs();
    std::span<const std::byte> bytes = buffer.first(size);
    for (;;) {
      const auto next = reader_->Next(bytes);
      if (!next) return Lose("invalid frame from the server: " + Describe(next.error()));
      if (!*next) break;
      const std::uint64_t id = connection_;
      Handle(**next);
      if (id != connection_) return;  // The message has ended the connection.
    }
    if (size < buffer.size()) break;
  }
  WaitToRead();
}

void Session::Handle(const protocol::FrameView& frame) {
  Expected<protocol::Message> message = protocol::DecodeMessage(frame);
  if (!message) {
    return Lose("invalid " + std::string(protocol::MessageTypeName(frame.type)) +
                " from the server: " + Describe(message.error()));
  }
  if (auto* welcome = std::get_if<protocol::Welcome>(&*message)) {
    if (state_ != State::kGreeting) return Lose("unexpected Welcome");
    welcome_ = std::move(*welcome);
    state_ = State::kReady;
    next_seq_ = 1;
    back_off_s_ = 0.0;
    if (was_ready_) ++reconnect_count_;
    was_ready_ = true;
    is_loss_reported_ = false;
    return OnWelcome();
  }
  if (const auto* error = std::get_if<protocol::ErrorNotice>(&*message);
      error != nullptr && error->fatal) {
    return Lose("error from the server: " + std::string(protocol::StatusCodeName(error->code)) +
                ": " + error->text);
  }
  if (const auto* goodbye = std::get_if<protocol::Goodbye>(&*message)) {
    return Lose("the server sent Goodbye (" + std::string(protocol::StatusCodeName(goodbye->code)) +
                ")");
  }
  if (std::holds_alternative<protocol::Pong>(*message)) return;
  if (state_ != State::kReady) return Lose("the server sent a message before Welcome");
  OnMessage(*message, protocol::kFrameHeaderBytes + frame.payload.size(), received_ns_);
}

void Session::Write() {
  if (!writing_.empty() || waiting_.empty()) return;
  std::swap(writing_, waiting_);
  written_ = 0;
  sent_ns_ = NowNs();
  // The socket buffer usually accepts the whole message at once.
  boost::system::error_code code;
  written_ = socket_->write_some(asio::buffer(writing_), code);
  if (code && code != asio::error::would_block && code != asio::error::try_again) {
    return Lose("connection lost: " + code.message());
  }
  if (written_ == writing_.size()) {
    writing_.clear();
    return;
  }
  socket_->async_wait(tcp::socket::wait_write,
                      [this, id = connection_](const boost::system::error_code& failed) {
                        if (id == connection_) OnWritten(failed);
                      });
}

void Session::OnWritten(const boost::system::error_code& failed) {
  if (failed) return Lose("connection lost: " + failed.message());
  boost::system::error_code code;
  written_ += socket_->write_some(
      asio::buffer(writing_.data() + written_, writing_.size() - written_), code);
  if (code && code != asio::error::would_block && code != asio::error::try_again) {
    return Lose("connection lost: " + code.message());
  }
  if (written_ == writing_.size()) {
    writing_.clear();
    return Write();
  }
  socket_->async_wait(tcp::socket::wait_write,
                      [this, id = connection_](const boost::system::error_code& again) {
                        if (id == connection_) OnWritten(again);
                      });
}

}  // namespace stridewire::load
