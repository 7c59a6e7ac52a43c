#include "net/connection.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <utility>

#include "base/check.h"
#include "stridewire/protocol/decode.h"

namespace stridewire::server {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

constexpr std::size_t kReadBufferBytes = std::size_t{32} << 10;
constexpr std::size_t kWriteBytes = std::size_t{256} << 10;
// A WebSocket connection that receives nothing sends pings at intervals of the idle timeout divided
// by this.
constexpr double kPingsPerIdleTimeout = 3.0;

}  // namespace

Connection::Connection(std::unique_ptr<Transport> transport, const Limits& limits,
                       ThreadMetrics& metrics)
    : transport_(std::move(transport)),
      kind_(transport_->kind()),
      timer_(transport_->executor()),
      wait_timer_(transport_->executor()),
      limits_(limits),
      metrics_(metrics),
      reader_(protocol::Sender::kClient, {limits.max_control_bytes, limits.max_bulk_bytes}),
      read_buffer_(kReadBufferBytes),
      queue_(limits.control_buffer_bytes, limits.observer_backlog_ticks),
      traffic_(metrics) {}

void Connection::Start(ConnectionHandler* handler, std::span<const std::byte> received) {
  STRIDEWIRE_CHECK(handler != nullptr && transport_ != nullptr && !is_reading_);
  handler_ = handler;
  transport_->Prepare(traffic_, limits_.socket_send_buffer_bytes);
  handed_over_.assign(received.begin(), received.end());
  unread_ = handed_over_;
  Watch();
  Process();
}

// ---- reading

void Connection::Process() {
  // A handler that resumes reading from within OnMessage must not start a second loop.
  if (is_processing_) return;
  is_processing_ = true;
  const auto self = shared_from_this();
  while (handler_ != nullptr && !is_closed_ && !is_paused_) {
    const auto next = transport_->has_messages() ? NextFrameOfMessages() : NextFrame();
    if (!next) {
      Refuse(next.error());
      break;
    }
    if (!next->has_value()) {
      Read();
      break;
    }
    metrics_.messages_received.Add();
    auto message = protocol::DecodeMessage(**next);
    if (!message) {
      Refuse(message.error());
      break;
    }
    handler_->OnMessage(*std::move(message));
  }
  is_processing_ = false;
}

Expected<std::optional<protocol::FrameView>> Connection::NextFrame() {
  return reader_.Next(unread_);
}

// A WebSocket message from a client must contain exactly one frame, in any number of fragments.
Expected<std::optional<protocol::FrameView>> Connection::NextFrameOfMessages() {
  if (is_text_) {
    close_code_ = CloseCode::kNotBinary;
    return Fail(ErrorCode::kUnsupported, "a WebSocket text message; expected binary messages");
  }
  if (!whole_) {
    auto next = reader_.Next(unread_);
    if (!next) return next;
    whole_ = *next;
    if (!whole_ && is_message_over_) {
      return Fail(ErrorCode::kMalformed, "a WebSocket message that ends before its frame");
    }
  }
  if (whole_ && !unread_.empty()) {
    return Fail(ErrorCode::kMalformed, "a WebSocket message that continues after its frame");
  }
  if (!is_message_over_) return std::nullopt;
  is_message_over_ = false;
  return std::exchange(whole_, std::nullopt);
}

void Connection::Refuse(const Error& error) {
  if (close_code_ == CloseCode::kNormal) {
    close_code_ =
        error.code == ErrorCode::kLimitExceeded ? CloseCode::kTooBig : CloseCode::kProtocolError;
  }
  handler_->OnBadFrame(error);
}

void Connection::ResumeReading() {
  if (!is_paused_) return;
  is_paused_ = false;
  if (!is_reading_ && !is_closing_) Process();
}

void Connection::Read() {
  if (is_reading_ || is_closed_) return;
  is_reading_ = true;
  transport_->Receive(shared_from_this(), read_buffer_);
}

void Connection::OnReceived(const error_code& error, const Transport::Chunk& chunk) {
  STRIDEWIRE_CHECK(is_reading_);
  is_reading_ = false;
  if (is_closed_) return;
  if (error) {
    Close();
    return;
  }
  if (is_closing_) {
    Read();  // Further bytes are received and discarded until the peer closes.
    return;
  }
  unread_ = chunk.bytes;
  is_text_ = chunk.is_text;
  is_message_over_ = chunk.ends_message;
  Process();
}

std::unique_ptr<Transport> Connection::Release(std::vector<std::byte>& received) {
  STRIDEWIRE_CHECK(!is_writing_ && !is_reading_ && queue_.empty());
  received.assign(unread_.begin(), unread_.end());
  handler_ = nullptr;
  is_closed_ = true;
  timer_.cancel();
  wait_timer_.cancel();
  transport_->Detach();
  return std::move(transport_);
}

// ---- writing

void Connection::SendControl(SharedFrame frame) {
  if (is_closed_ || is_closing_) return;
  queue_.PushControl(std::move(frame));
  ScheduleFlush();
}

bool Connection::SendEvents(SharedFrame frame) {
  if (is_closed_ || is_closing_ || !queue_.PushEvents(std::move(frame))) return false;
  ScheduleFlush();
  return true;
}

void Connection::SendTerrain(WorldId world, SharedFrame frame) {
  if (is_closed_ || is_closing_) return;
  queue_.PushTerrain(world, std::move(frame));
  ScheduleFlush();
}

std::size_t Connection::SendMovements(WorldId world, int shard, SharedFrame frame, double wait_s) {
  if (is_closed_ || is_closing_) return 0;
  const std::size_t dropped = queue_.PushMovements(world, shard, std::move(frame));
  ScheduleFlush(wait_s);
  return dropped;
}

std::size_t Connection::SendPoses(PoseFrames&& batch, double wait_s) {
  if (is_closed_ || is_closing_) return 0;
  const std::size_t dropped = queue_.PushPoses(std::move(batch));
  ScheduleFlush(wait_s);
  return dropped;
}

void Connection::ScheduleFlush(double wait_s) {
  if (wait_s > 0.0 && kind_ == TransportKind::kWebSocket) {
    if (!is_urgent_) Wait(wait_s);
    return;
  }
  is_urgent_ = true;
  // Flush is posted, so that all frames of a tick are sent in one write.
  if (is_writing_ || is_flush_scheduled_) return;
  is_flush_scheduled_ = true;
  asio::post(transport_->executor(), [self = shared_from_this()] {
    self->is_flush_scheduled_ = false;
    self->Flush();
  });
}

// Delays queued frames by up to `wait_s`. If frames are already waiting, the earlier of the two
// deadlines applies.
void Connection::Wait(double wait_s) {
  const auto until = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                        std::chrono::duration<double>(wait_s));
  if (is_waiting_ && wait_until_ <= until) return;
  is_waiting_ = true;
  wait_until_ = until;
  wait_timer_.expires_at(until);
  wait_timer_.async_wait([weak = weak_from_this()](const error_code& error) {
    const auto self = weak.lock();
    if (error || self == nullptr || !self->is_waiting_) return;
    self->is_waiting_ = false;
    self->Flush();
  });
}

void Connection::Flush() {
  while (!is_writing_ && !is_closed_ && !is_lingering_ && (is_urgent_ || !is_waiting_)) {
    queue_.Gather(kWriteBytes, in_flight_);
    is_waiting_ = false;
    is_urgent_ = !queue_.empty();
    if (in_flight_.frames.empty()) {
      if (is_closing_) BeginLinger();
      return;
    }
    metrics_.poses_sent.Add(in_flight_.poses);
    metrics_.batches_sent.Add(in_flight_.batches);
    if (kind_ == TransportKind::kWebSocket) {
      const std::size_t joined = in_flight_.stream_frames;
      metrics_.websocket_messages_sent.Add(in_flight_.frames.size() - joined +
                                           (joined > 0 ? 1 : 0));
    }
    traffic_.BeginToSend();
    is_writing_ = true;
    if (!transport_->Send(shared_from_this(), in_flight_.frames, in_flight_.stream_frames)) return;
    is_writing_ = false;
    Sent();
  }
}

void Connection::Sent() {
  in_flight_.clear();
  if (handler_ != nullptr) handler_->OnSent();
}

void Connection::OnSent(const error_code& error) {
  STRIDEWIRE_CHECK(is_writing_);
  is_writing_ = false;
  if (is_closed_) return;
  if (error) {
    Close();
    return;
  }
  Sent();
  Flush();
}

// ---- ending

void Connection::Watch() {
  // One timer checks all timeouts. It does not need to be precise.
  double shortest_s = limits_.write_timeout_s;
  if (limits_.idle_timeout_s > 0.0) shortest_s = std::min(shortest_s, limits_.idle_timeout_s);
  const double interval_s = std::clamp(shortest_s / 8.0, 0.01, 0.5);
  timer_.expires_after(
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(interval_s)));
  timer_.async_wait([weak = weak_from_this()](const error_code& error) {
    const auto self = weak.lock();
    if (error || self == nullptr || self->is_closed_) return;
    const auto now = Clock::now();
    const auto seconds_since = [now](Clock::time_point then) {
      return std::chrono::duration<double>(now - then).count();
    };
    if (self->is_closing_) {
      if (now - self->closing_since_ > kLinger) {
        self->Close();
        return;
      }
    } else if (self->is_writing_ &&
               seconds_since(self->traffic_.last_sent()) > self->limits_.write_timeout_s) {
      if (self->handler_ != nullptr) self->handler_->OnStuck();
    } else if (self->limits_.idle_timeout_s > 0.0 && !self->is_paused_ &&
               seconds_since(self->traffic_.last_received()) > self->limits_.idle_timeout_s) {
      if (self->handler_ != nullptr) self->handler_->OnIdle();
    } else if (self->limits_.idle_timeout_s > 0.0) {
      const double ping_s = self->limits_.idle_timeout_s / kPingsPerIdleTimeout;
      if (seconds_since(std::max(self->traffic_.last_received(), self->kept_alive_)) > ping_s) {
        self->kept_alive_ = now;
        self->transport_->KeepAlive(self);
      }
    }
    if (!self->is_closed_) self->Watch();
  });
}

void Connection::CloseGently(CloseCode code) {
  if (is_closed_ || is_closing_) return;
  if (close_code_ == CloseCode::kNormal) close_code_ = code;
  is_closing_ = true;
  handler_ = nullptr;
  closing_since_ = Clock::now();
  queue_.DropAllPoses();
  is_urgent_ = true;
  // Reading continues until the peer closes. The received bytes are discarded.
  if (!is_processing_)
    Read();
  else
    asio::post(transport_->executor(), [self = shared_from_this()] { self->Read(); });
  Flush();
}

void Connection::BeginLinger() {
  STRIDEWIRE_CHECK(is_closing_ && !is_lingering_ && queue_.empty());
  is_lingering_ = true;
  if (!transport_->End(shared_from_this(), close_code_)) Close();
}

void Connection::Close() {
  if (is_closed_) return;
  // Close may end the last operation that keeps this object alive.
  const auto self = shared_from_this();
  is_closed_ = true;
  timer_.cancel();
  wait_timer_.cancel();
  transport_->Close();
  if (handler_ != nullptr) std::exchange(handler_, nullptr)->OnClosed();
}

}  // namespace stridewire::server
