#include "session/handshake.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/steady_timer.hpp>
#include <utility>

#include "stridewire/protocol/encoder.h"
#include "world/convert.h"

namespace stridewire::server {

using protocol::StatusCode;

/// A connection that has not said Hello yet.
class Gate::Handshake : public ConnectionHandler, public std::enable_shared_from_this<Handshake> {
 public:
  Handshake(Gate& gate, std::unique_ptr<Transport> transport, std::string address)
      : gate_(gate),
        timer_(gate.context_),
        address_(std::move(address)),
        connection_(std::make_shared<Connection>(std::move(transport), gate.handshake_limits_,
                                                 gate.metrics_)) {}
  ~Handshake() override { connection_->set_handler(nullptr); }

  void Start() {
    timer_.expires_after(std::chrono::duration_cast<std::chrono::nanoseconds>(
        std::chrono::duration<double>(gate_.limits_.handshake_timeout_s)));
    timer_.async_wait([weak = weak_from_this()](const boost::system::error_code& error) {
      const auto self = weak.lock();
      if (error || self == nullptr) return;
      self->gate_.metrics_.Reached(Limit::kHandshakeTimeout);
      self->Refuse(StatusCode::kTimeout, "no Hello came in time");
    });
    connection_->Start(this);
  }

  /// Says why, closes gently and is gone.
  void Refuse(StatusCode code, const std::string& text) {
    spdlog::info("{}: {}", address_, text);
    auto frame = std::make_shared<std::vector<std::byte>>();
    if (protocol::Encoder().Encode(protocol::ErrorNotice{.code = code, .text = text, .fatal = true},
                                   *frame)) {
      connection_->SendControl(std::move(frame));
    }
    connection_->CloseGently(CloseCodeOf(code));
    gate_.Forget(*this);
  }

  void OnMessage(protocol::Message&& message) override {
    if (const auto* hello = std::get_if<protocol::Hello>(&message)) {
      gate_.OnHello(*this, *hello);
      return;
    }
    gate_.metrics_.protocol_errors.Add();
    Refuse(StatusCode::kUnexpectedMessage, "the first message is Hello");
  }

  void OnBadFrame(const Error& error) override {
    gate_.metrics_.protocol_errors.Add();
    if (error.code == ErrorCode::kLimitExceeded) gate_.metrics_.Reached(Limit::kFrameBytes);
    Refuse(FrameStatusCode(error.code), Describe(error));
  }

  void OnClosed() override { gate_.Forget(*this); }

  [[nodiscard]] const std::string& address() const { return address_; }
  [[nodiscard]] Connection& connection() { return *connection_; }

 private:
  Gate& gate_;
  boost::asio::steady_timer timer_;
  std::string address_;
  std::shared_ptr<Connection> connection_;
};

Gate::Gate(boost::asio::io_context& context, const Limits& limits, ThreadMetrics& metrics,
           SessionDirectory& directory, std::function<void(int, Shard::Arrival)> adopt)
    : context_(context),
      limits_(limits),
      handshake_limits_(limits),
      metrics_(metrics),
      directory_(directory),
      adopt_(std::move(adopt)) {
  // Nothing larger than a Hello is held for somebody who has not said it.
  handshake_limits_.max_control_bytes =
      std::min(limits.max_control_bytes, protocol::kMaxHelloBytes);
  handshake_limits_.max_bulk_bytes = handshake_limits_.max_control_bytes;
  handshake_limits_.idle_timeout_s = 0.0;  // the handshake has its own
}

Gate::~Gate() = default;

void Gate::Accept(std::unique_ptr<Transport> transport, const boost::asio::ip::address& remote) {
  if (is_closed_) return;
  metrics_.connections_accepted.Add();
  const std::string address = remote.to_string();
  if (handshakes_.size() >= static_cast<std::size_t>(limits_.max_handshakes)) {
    metrics_.Reached(Limit::kHandshakes);
    return;  // closes it; a word to each would only help a flood
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

void Gate::OnHello(Handshake& handshake, const protocol::Hello& hello) {
  if (hello.protocol_min > protocol::kProtocolMax || hello.protocol_max < protocol::kProtocolMin) {
    handshake.Refuse(StatusCode::kVersionMismatch,
                     "this server speaks versions " + std::to_string(protocol::kProtocolMin) +
                         " to " + std::to_string(protocol::kProtocolMax));
    return;
  }
  Shard::Arrival arrival;
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
  Forget(handshake);
  adopt_(shard, std::move(arrival));
}

void Gate::Forget(Handshake& handshake) {
  const auto it = handshakes_.find(&handshake);
  if (it == handshakes_.end()) return;
  // It may be in the middle of a call from its connection.
  const std::shared_ptr<Handshake> keep = std::move(it->second);
  handshakes_.erase(it);
  const auto count = address_counts_.find(keep->address());
  if (--count->second == 0) address_counts_.erase(count);
  boost::asio::post(context_, [keep] {});
}

void Gate::Close() {
  is_closed_ = true;
  while (!handshakes_.empty()) {
    handshakes_.begin()->second->Refuse(StatusCode::kShuttingDown, "the server is shutting down");
  }
}

}  // namespace stridewire::server
