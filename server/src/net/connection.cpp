#include "net/connection.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <utility>

#include "stridewire/base/check.h"
#include "stridewire/protocol/decode.h"

namespace stridewire::server {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

constexpr std::size_t kReadBufferBytes = std::size_t{32} << 10;
constexpr std::size_t kWriteBytes = std::size_t{256} << 10;

// A borrowed buffer sequence: Asio copies the sequence it is given, which for a vector is a heap
// allocation a write.
struct BufferList {
  // Names that Asio asks for.
  using value_type = asio::const_buffer;             // NOLINT(readability-identifier-naming)
  using const_iterator = const asio::const_buffer*;  // NOLINT(readability-identifier-naming)
  const_iterator first;
  const_iterator last;
  [[nodiscard]] const_iterator begin() const { return first; }
  [[nodiscard]] const_iterator end() const { return last; }
};

}  // namespace

Connection::Connection(Socket socket, const Limits& limits, ThreadMetrics& metrics)
    : socket_(std::move(socket)),
      timer_(socket_.get_executor()),
      limits_(limits),
      metrics_(metrics),
      reader_(protocol::Sender::kClient, {limits.max_control_bytes, limits.max_bulk_bytes}),
      read_buffer_(kReadBufferBytes),
      queue_(limits.control_buffer_bytes, limits.observer_backlog_ticks),
      last_received_(Clock::now()),
      last_written_(last_received_) {}

void Connection::Start(ConnectionHandler* handler, std::span<const std::byte> received) {
  handler_ = handler;
  error_code ignored;  // a socket that fails here fails when it is read, too
  socket_.set_option(asio::ip::tcp::no_delay(true), ignored);
  if (limits_.socket_send_buffer_bytes > 0) {
    socket_.set_option(
        asio::socket_base::send_buffer_size(static_cast<int>(limits_.socket_send_buffer_bytes)),
        ignored);
  }
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
    auto next = reader_.Next(unread_);
    if (!next) {
      handler_->OnBadFrame(next.error());
      break;
    }
    if (!next->has_value()) {
      Read();
      break;
    }
    metrics_.messages_received.Add();
    auto message = protocol::DecodeMessage(**next);
    if (!message) {
      handler_->OnBadFrame(message.error());
      break;
    }
    handler_->OnMessage(*std::move(message));
  }
  is_processing_ = false;
}

void Connection::ResumeReading() {
  if (!is_paused_) return;
  is_paused_ = false;
  if (!is_reading_ && !is_closing_) Process();
}

void Connection::Read() {
  if (is_reading_ || is_closed_) return;
  is_reading_ = true;
  socket_.async_read_some(asio::buffer(read_buffer_),
                          [self = shared_from_this()](const error_code& error, std::size_t bytes) {
                            self->OnRead(error, bytes);
                          });
}

void Connection::OnRead(const error_code& error, std::size_t bytes) {
  is_reading_ = false;
  if (is_closed_) return;
  if (error) {
    Close();
    return;
  }
  last_received_ = Clock::now();
  metrics_.bytes_received.Add(bytes);
  if (is_closing_) {
    Read();  // whatever still comes is thrown away
    return;
  }
  unread_ = std::span(read_buffer_).first(bytes);
  Process();
}

Connection::Socket::native_handle_type Connection::Release(std::vector<std::byte>& received) {
  STRIDEWIRE_CHECK(!is_writing_ && !is_reading_ && queue_.empty());
  received.assign(unread_.begin(), unread_.end());
  handler_ = nullptr;
  is_closed_ = true;
  timer_.cancel();
  error_code ignored;
  return socket_.release(ignored);
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

std::size_t Connection::SendPoses(const PoseDelivery& delivery) {
  if (is_closed_ || is_closing_) return 0;
  const std::size_t dropped = queue_.PushPoses(delivery);
  ScheduleFlush();
  return dropped;
}

void Connection::ScheduleFlush() {
  // Later in the same round, so that what a tick brings goes out in one write.
  if (is_writing_ || is_flush_scheduled_) return;
  is_flush_scheduled_ = true;
  asio::post(socket_.get_executor(), [self = shared_from_this()] {
    self->is_flush_scheduled_ = false;
    self->Flush();
  });
}

void Connection::Flush() {
  if (is_writing_ || is_closed_ || is_lingering_) return;
  queue_.Gather(kWriteBytes, in_flight_);
  if (in_flight_.frames.empty()) {
    if (is_closing_) BeginLinger();
    return;
  }
  metrics_.poses_sent.Add(in_flight_.poses);
  metrics_.batches_sent.Add(in_flight_.batches);
  buffers_.clear();
  for (const SharedFrame& frame : in_flight_.frames) {
    buffers_.emplace_back(frame->data(), frame->size());
  }
  first_buffer_ = 0;
  last_written_ = Clock::now();
  Write();
}

void Connection::Write() {
  is_writing_ = true;
  const BufferList buffers{buffers_.data() + first_buffer_, buffers_.data() + buffers_.size()};
  socket_.async_write_some(buffers,
                           [self = shared_from_this()](const error_code& error, std::size_t bytes) {
                             self->OnWritten(error, bytes);
                           });
}

void Connection::OnWritten(const error_code& error, std::size_t bytes) {
  is_writing_ = false;
  if (is_closed_) return;
  if (error) {
    Close();
    return;
  }
  metrics_.bytes_sent.Add(bytes);
  last_written_ = Clock::now();
  while (bytes > 0) {
    asio::const_buffer& buffer = buffers_[first_buffer_];
    const std::size_t taken = std::min(bytes, buffer.size());
    buffer += taken;
    bytes -= taken;
    if (buffer.size() == 0) ++first_buffer_;
  }
  if (first_buffer_ < buffers_.size()) {
    Write();
    return;
  }
  in_flight_.clear();
  if (handler_ != nullptr) handler_->OnSent();
  Flush();
}

// ---- ending

void Connection::Watch() {
  // One timer looks after all timeouts; it need not be exact.
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
               seconds_since(self->last_written_) > self->limits_.write_timeout_s) {
      if (self->handler_ != nullptr) self->handler_->OnStuck();
    } else if (self->limits_.idle_timeout_s > 0.0 && !self->is_paused_ &&
               seconds_since(self->last_received_) > self->limits_.idle_timeout_s) {
      if (self->handler_ != nullptr) self->handler_->OnIdle();
    }
    if (!self->is_closed_) self->Watch();
  });
}

void Connection::CloseGently() {
  if (is_closed_ || is_closing_) return;
  is_closing_ = true;
  handler_ = nullptr;
  closing_since_ = Clock::now();
  queue_.DropAllPoses();
  // Bytes that come from now on are only thrown away.
  if (!is_processing_)
    Read();
  else
    asio::post(socket_.get_executor(), [self = shared_from_this()] { self->Read(); });
  Flush();
}

void Connection::BeginLinger() {
  is_lingering_ = true;
  error_code error;
  socket_.shutdown(asio::ip::tcp::socket::shutdown_send, error);
  if (error) Close();
}

void Connection::Close() {
  if (is_closed_) return;
  is_closed_ = true;
  timer_.cancel();
  error_code ignored;
  socket_.close(ignored);
  if (handler_ != nullptr) std::exchange(handler_, nullptr)->OnClosed();
}

}  // namespace stridewire::server
