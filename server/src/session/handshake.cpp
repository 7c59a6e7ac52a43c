#include "session/handshake.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <utility>

#include "base/check.h"
#include "stridewire/protocol/encoder.h"
#include "world/convert.h"

namespace stridewire::server {

using protocol::StatusCode;

/// A connection whose client has not sent Hello yet.
class Handshakes::Handshake : public ConnectionHandler,
                              public std::enable_shared_from_this<Handshake> {
 public:
  Handshake(Handshakes& owner, std::unique_ptr<Transport> transport, std::string address)
      : owner_(owner),
        timer_(owner.context_),
        address_(std::move(address)),
        connection_(std::make_shared<Connection>(std::move(transport), owner.handshake_limits_,
                                                 owner.metrics_)) {}
  ~Handshake() override { connection_->set_handler(nullptr); }

  void Start() {
    timer_.expires_after(std::chrono::duration_cast<std::chrono::nanoseconds>(
        std::chrono::duration<double>(owner_.limits_.handshake_timeout_s)));
    timer_.async_wait([weak = weak_from_this()](const boost::system::error_code& error) {
      const auto self = weak.lock();
      if (error || self == nullptr) return;
      self->owner_.metrics_.Reached(Limit::kHandshakeTimeout);
      self->Refuse(StatusCode::kTimeout, "no Hello was received in time (handshake_timeout_s)");
    });
    connection_->Start(this);
  }

  /// Sends a fatal error, closes the connection and removes this handshake.
  void Refuse(StatusCode code, const std::string& text) {
    spdlog::info("handshake with {} refused: {}", address_, text);
    auto frame = std::make_shared<std::vector<std::byte>>();
    if (protocol::Encoder().Encode(protocol::ErrorNotice{.code = code, .text = text, .fatal = true},
                                   *frame)) {
      connection_->SendControl(std::move(frame));
    }
    connection_->CloseGently(CloseCodeOf(code));
    owner_.Remove(*this);
  }

  void OnMessage(protocol::Message&& message) override {
    if (const auto* hello = std::get_if<protocol::Hello>(&message)) {
      owner_.OnHello(*this, *hello);
      return;
    }
    owner_.metrics_.protocol_errors.Add();
    Refuse(StatusCode::kUnexpectedMessage, "the first message must be Hello");
  }

  void OnBadFrame(const Error& error) override {
    owner_.metrics_.protocol_errors.Add();
    if (error.code == ErrorCode::kLimitExceeded) owner_.metrics_.Reached(Limit::kFrameBytes);
    Refuse(FrameStatusCode(error.code), Describe(error));
  }

  void OnClosed() override { owner_.Remove(*this); }

  [[nodiscard]] const std::string& address() const { return address_; }
  [[nodiscard]] Connection& connection() { return *connection_; }

 private:
  Handshakes& owner_;
  boost::asio::steady_timer timer_;
  std::string address_;
  std::shared_ptr<Connection> connection_;
};

Handshakes::Handshakes(boost::asio::io_context& context, const Limits& limits,
                       ThreadMetrics& metrics, SessionDirectory& directory, Adopt adopt)
    : context_(context),
      limits_(limits),
      handshake_limits_(limits),
      metrics_(metrics),
      directory_(directory),
      adopt_(std::move(adopt)) {
  // Before Hello, frames may not be larger than a Hello.
  handshake_limits_.max_control_bytes =
      std::min(limits.max_control_bytes, protocol::kMaxHelloBytes);
  handshake_limits_.max_bulk_bytes = handshake_limits_.max_control_bytes;
  // The handshake has its own timeout, handshake_timeout_s.
  handshake_limits_.idle_timeout_s = 0.0;
}

Handshakes::~Handshakes() = default;

void Handshakes::Accept(std::unique_ptr<Transport> transport,
                        const boost::asio::ip::address& remote) {
  if (is_closed_) return;
  metrics_.connections_accepted.Add();
  const std::string address = remote.to_string();
  if (handshakes_.size() >= static_cast<std::size_t>(limits_.max_handshakes)) {
    metrics_.Reached(Limit::kHandshakes);
    // Closes the connection without a message. Sending one would only make a flood of connections
    // more expensive.
    return;
  }
  int& count = address_counts_[address];
  if (count >= limits_.max_sessions_per_address) {
    metrics_.Reached(Limit::kSessionsPerAddress);
    return;
  }
  ++count;
  auto handshake = std::make_shared<Handshake>(*this, std::move(transport), address);
  handshakes_.emplace(handshake.get(), handshake);
  handshake->Start();
}

void Handshakes::OnHello(Handshake& handshake, const protocol::Hello& hello) {
  if (hello.protocol_min > protocol::kProtocolVersion ||
      hello.protocol_max < protocol::kProtocolVersion) {
    handshake.Refuse(StatusCode::kVersionMismatch, "this server supports protocol version " +
                                                       std::to_string(protocol::kProtocolVersion) +
                                                       " only");
    return;
  }
  Arrival arrival;
  int shard = 0;
  const SessionDirectory::Entry* known =
      hello.resume_token.empty() ? nullptr : directory_.Find(hello.resume_token);
  if (known != nullptr) {
    arrival.identity = known->identity;
    arrival.is_resuming = true;
    shard = known->shard;
  } else {
    Limit reached = Limit::kSessions;
    auto opened = directory_.Open(handshake.address(), reached);
    if (!opened) {
      metrics_.Reached(reached);
      handshake.Refuse(opened.error().code, opened.error().text);
      return;
    }
    arrival.identity = std::move(opened->identity);
    shard = opened->shard;
  }
  arrival.hello = hello;
  arrival.transport = handshake.connection().Release(arrival.received);
  Remove(handshake);
  adopt_(shard, std::move(arrival));
}

void Handshakes::Remove(Handshake& handshake) {
  const auto it = handshakes_.find(&handshake);
  if (it == handshakes_.end()) return;
  // The handshake or its connection may be calling this function, so their destruction is posted.
  const std::shared_ptr<Handshake> removed = std::move(it->second);
  handshakes_.erase(it);
  const auto count = address_counts_.find(removed->address());
  STRIDEWIRE_CHECK(count != address_counts_.end() && count->second > 0);
  if (--count->second == 0) address_counts_.erase(count);
  STRIDEWIRE_CHECK(handshakes_.empty() == address_counts_.empty());
  boost::asio::post(context_, [removed] {});
}

void Handshakes::Close() {
  is_closed_ = true;
  while (!handshakes_.empty()) {
    handshakes_.begin()->second->Refuse(StatusCode::kShuttingDown, "the server is shutting down");
  }
}

}  // namespace stridewire::server
