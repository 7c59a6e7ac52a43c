#include "session.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "base/check.h"
#include "stridewire/protocol/decode.h"

namespace stridewire::client {

namespace {

constexpr std::size_t kMaxPendingPings = 64;

}  // namespace

template <typename Message>
void Session::Handle(const Message&, double now_s) {
  LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent a message that only clients may send",
                 now_s);
}

bool Session::ConnectDue(double now_s) const {
  return state_ == State::kWaiting && now_s >= next_attempt_s_;
}

void Session::StartConnecting(double now_s) {
  STRIDEWIRE_CHECK(state_ == State::kWaiting);
  state_ = State::kConnecting;
  deadline_s_ = now_s + options_.connect_timeout_s;
  ++connection_number_;
}

void Session::OnConnected(double now_s) {
  if (state_ != State::kConnecting) return;
  state_ = State::kGreeting;
  libraries_.OnConnectionLost();
  deadline_s_ = now_s + options_.connect_timeout_s;
  heard_s_ = now_s;
  reader_.emplace(protocol::Sender::kServer);
  encoder_ = protocol::Encoder();
  output_.clear();
  protocol::Hello hello;
  hello.client_name = options_.client_name;
  hello.auth_token = options_.auth_token;
  hello.resume_token = resume_token_;
  hello.last_events_number = resume_token_.empty() ? 0 : last_events_number_;
  if (Status status = encoder_.Encode(hello, output_); !status) {
    CloseWithError(STRIDEWIRE_INVALID_ARGUMENT, Describe(status.error()));
  }
}

bool Session::Receives() const { return state_ == State::kGreeting || state_ == State::kReady; }

bool Session::HandleFrame(const protocol::FrameView& frame, double now_s) {
  const std::uint64_t connection = connection_number_;
  auto message = protocol::DecodeMessage(frame);
  if (!message) {
    LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, Describe(message.error()), now_s);
    return false;
  }
  std::visit([&](const auto& m) { Handle(m, now_s); }, *message);
  return connection == connection_number_ && Receives();
}

void Session::OnMessage(std::span<const std::byte> message, double now_s) {
  answered_command_ = 0;
  if (!Receives()) return;
  heard_s_ = now_s;
  bytes_received_ += message.size();
  for (bool is_first = true; is_first || !message.empty(); is_first = false) {
    const auto frame = reader_->Next(message);
    if (!frame) return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, Describe(frame.error()), now_s);
    if (!*frame) {
      return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR,
                            "the server sent a WebSocket message that ends within a frame", now_s);
    }
    const protocol::MessageType type = (*frame)->type;
    const bool is_alone = is_first && message.empty();
    if (!is_alone && type != protocol::MessageType::kPoseBatch &&
        type != protocol::MessageType::kMovements) {
      return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR,
                            "the server sent a WebSocket message with several frames, of which one "
                            "is neither PoseBatch nor Movements",
                            now_s);
    }
    if (!HandleFrame(**frame, now_s)) return;
  }
  Pump();
}

void Session::OnBytes(std::span<const std::byte> bytes, double now_s) {
  if (!Receives()) return;
  heard_s_ = now_s;
  bytes_received_ += bytes.size();
  for (;;) {
    auto frame = reader_->Next(bytes);
    if (!frame) return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, Describe(frame.error()), now_s);
    if (!*frame) break;
    if (!HandleFrame(**frame, now_s)) return;
  }
  Pump();
}

void Session::OnLost(stridewire_status status, std::string_view text, double now_s) {
  if (state_ == State::kClosing) {
    state_ = State::kIdle;
    output_.clear();
  } else if (state_ == State::kConnecting || state_ == State::kGreeting ||
             state_ == State::kReady) {
    LoseConnection(status, text, now_s);
  }
}

void Session::AdvanceTime(double now_s) {
  switch (state_) {
    case State::kConnecting:
      if (now_s >= deadline_s_)
        LoseConnection(STRIDEWIRE_TIMEOUT, "the connection attempt timed out", now_s);
      break;
    case State::kGreeting:
      if (now_s >= deadline_s_) {
        LoseConnection(STRIDEWIRE_TIMEOUT, "the server did not answer Hello in time", now_s);
      }
      break;
    case State::kReady:
      // All inspections have the same timeout, so the oldest one expires first.
      while (!inspections_.empty() && now_s >= inspections_.begin()->second) {
        EndInspection(inspections_.begin()->first, STRIDEWIRE_TIMEOUT);
      }
      if (limits_.idle_timeout_s > 0.0 && now_s - heard_s_ > limits_.idle_timeout_s) {
        LoseConnection(STRIDEWIRE_TIMEOUT, "the server sent nothing for too long", now_s);
      } else if (now_s >= next_ping_s_) {
        // If the output buffer is full, its contents prove to the server that the client is alive,
        // so no ping is necessary.
        if (output_.size() < kMaxOutputBytes) {
          SendPing(now_s);
        } else {
          SchedulePing(now_s);
        }
      }
      break;
    case State::kClosing:
      if (now_s >= deadline_s_) {
        state_ = State::kIdle;
        output_.clear();
      }
      break;
    default: break;
  }
}

double Session::NextTime() const {
  switch (state_) {
    case State::kWaiting: return next_attempt_s_;
    case State::kConnecting:
    case State::kGreeting:
    case State::kClosing: return deadline_s_;
    case State::kReady:
      return limits_.idle_timeout_s > 0.0
                 ? std::min(next_ping_s_, heard_s_ + limits_.idle_timeout_s)
                 : next_ping_s_;
    case State::kIdle:
    case State::kClosed: break;
  }
  return std::numeric_limits<double>::infinity();
}

bool Session::NeedsSocket() const {
  return state_ == State::kConnecting || state_ == State::kGreeting || state_ == State::kReady ||
         state_ == State::kClosing;
}

bool Session::TakeOutput(std::vector<std::byte>& bytes) {
  if (state_ == State::kReady) Pump();
  if (output_.empty()) return false;
  bytes.clear();
  std::swap(bytes, output_);
  bytes_sent_ += bytes.size();
  return true;
}

void Session::OnOutputWritten() {
  if (state_ == State::kClosing && output_.empty()) state_ = State::kIdle;
}

void Session::SendPing(double now_s) {
  // Encoding does not fail, because the time is finite.
  (void)encoder_.Encode(protocol::Ping{++ping_nonce_, now_s}, output_);
  SchedulePing(now_s);
}

void Session::SchedulePing(double now_s) {
  double interval_s = options_.ping_interval_s;
  if (limits_.idle_timeout_s > 0.0) interval_s = std::min(interval_s, limits_.idle_timeout_s / 3.0);
  next_ping_s_ = now_s + interval_s;
}

void Session::LoseConnection(stridewire_status status, std::string_view text, double now_s) {
  last_status_ = status;
  last_text_ = text.empty() ? stridewire_status_text(status) : text;
  STRIDEWIRE_CHECK(NeedsSocket() && state_ != State::kClosing);
  const bool was_ready = state_ == State::kReady;
  if (playout_.ready()) playout_.OnStall(now_s);
  if (was_ready && now_s - ready_s_ >= kStableS) backoff_.Reset();
  if (!was_ready) ++connect_failures_;
  state_ = State::kWaiting;
  if (addresses_.size() > 1) {
    last_text_ = addresses_[address_] + ": " + last_text_;
  }
  ScheduleAttempt(was_ready, status == STRIDEWIRE_SHUTTING_DOWN, now_s);
  output_.clear();
  pending_pings_.clear();
  EndInspections();
  events_.Push(
      MakeEvent(was_ready ? STRIDEWIRE_EVENT_CONNECTION_LOST : STRIDEWIRE_EVENT_CONNECT_FAILED, 0,
                status, last_text_));
}

void Session::EndInspections() {
  while (!inspections_.empty()) {
    EndInspection(inspections_.begin()->first, STRIDEWIRE_CONNECTION_LOST);
  }
}

void Session::ScheduleAttempt(bool was_ready, bool server_leaves, double now_s) {
  const std::size_t count = std::max<std::size_t>(addresses_.size(), 1);
  if (was_ready && !(server_leaves && count > 1)) {
    // The client tries the same address again, because only that server can resume the session.
    failed_attempts_ = 0;
    next_attempt_s_ = now_s + backoff_.Next();
    return;
  }
  address_ = (address_ + 1) % count;
  failed_attempts_ = was_ready ? 0 : failed_attempts_ + 1;
  // After a shutdown, the delays spread the reconnects of all clients over time.
  const bool waits = was_ready || failed_attempts_ >= count;
  next_attempt_s_ = waits ? now_s + backoff_.Next() : now_s;
  if (waits) failed_attempts_ = 0;
}

std::string_view Session::AddressText() const {
  return address_ < addresses_.size() ? std::string_view(addresses_[address_]) : "";
}

void Session::CloseWithError(stridewire_status status, std::string_view text) {
  last_status_ = status;
  last_text_ = text.empty() ? stridewire_status_text(status) : text;
  if (state_ != State::kReady) ++connect_failures_;
  state_ = State::kClosed;
  FailAll(status, last_text_);
  DetachWorlds();
  Reset();
  events_.Push(MakeEvent(STRIDEWIRE_EVENT_CLOSED, 0, status, last_text_));
}

void Session::DetachWorlds() {
  std::erase_if(worlds_, [&](const auto& entry) {
    const World::State state = entry.second.state;
    return !options_.keep_worlds || state == World::State::kRefused || state == World::State::kLeft;
  });
  for (auto& [handle, world] : worlds_) {
    ResetWorld(handle, world);
    world.spawned.clear();
    // RestoreSession creates the Observe of each subscription again.
    for (auto& [id, subscription] : world.subscriptions) subscription.unsent = false;
  }
}

void Session::Reset() {
  ++connection_number_;  // A socket that is still open no longer belongs to the session.
  had_session_ = false;
  resume_token_.clear();
  next_seq_ = 1;
  resend_from_ = 0;
  last_events_number_ = 0;
  clock_.Reset();
  playout_.Reset();
  rtts_s_.clear();
  pending_pings_.clear();
  EndInspections();
  output_.clear();
}

stridewire_status Session::Open(double now_s, std::vector<std::string> addresses) {
  switch (state_) {
    case State::kIdle:
    case State::kClosing:
    case State::kClosed: break;
    default: return Refuse(STRIDEWIRE_ALREADY_CONNECTED, "the client is already connected");
  }
  Reset();
  backoff_.Reset();
  addresses_ = std::move(addresses);
  address_ = 0;
  failed_attempts_ = 0;
  last_status_ = STRIDEWIRE_OK;
  last_text_.clear();
  state_ = State::kWaiting;
  next_attempt_s_ = now_s;
  return STRIDEWIRE_OK;
}

void Session::Close(double now_s) {
  if (state_ == State::kIdle || state_ == State::kClosing) return;
  const bool was_closed = state_ == State::kClosed;
  const bool sends_goodbye = state_ == State::kReady;
  FailAll(STRIDEWIRE_CANCELLED, "the client was disconnected");
  auto output = std::move(output_);
  const std::uint64_t connection = connection_number_;
  DetachWorlds();
  Reset();
  state_ = State::kIdle;
  if (sends_goodbye) {
    output_ = std::move(output);
    if (encoder_.Encode(protocol::Goodbye{}, output_)) {
      state_ = State::kClosing;
      connection_number_ = connection;
      deadline_s_ = now_s + kGoodbyeS;
    }
  }
  if (!was_closed) events_.Push(MakeEvent(STRIDEWIRE_EVENT_CLOSED));
}

stridewire_status Session::Ping(double now_s) {
  if (state_ != State::kReady) return Refuse(STRIDEWIRE_NOT_READY, "the client is not connected");
  if (pending_pings_.size() >= kMaxPendingPings) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many pings are unanswered");
  }
  SendPing(now_s);
  pending_pings_.insert(ping_nonce_);
  return STRIDEWIRE_OK;
}

}  // namespace stridewire::client
