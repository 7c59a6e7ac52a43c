#pragma once

#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/limits.h"
#include "base/metrics.h"
#include "net/send_queue.h"
#include "net/transport.h"
#include "stridewire/protocol/frame_reader.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::server {

/// Receives the events of a connection, on the thread of the connection.
class ConnectionHandler {
 public:
  virtual ~ConnectionHandler() = default;
  virtual void OnMessage(protocol::Message&& message) = 0;
  /// Called when the peer has sent invalid bytes. The connection does not read anything after them.
  virtual void OnBadFrame(const Error& error) = 0;
  /// Called when frames were sent, so that the send queue has room again.
  virtual void OnSent() {}
  /// Called when no bytes were received for idle_timeout_s, unless reading is paused.
  virtual void OnIdle() {}
  /// Called when a pending write has made no progress for write_timeout_s.
  virtual void OnStuck() {}
  /// Called when the connection is closed. This is the last call.
  virtual void OnClosed() = 0;
};

/// One client connection: splits received bytes into frames, sends the frames of its SendQueue and
/// checks timeouts. Transport hides the difference between TCP and WebSocket.
///
///   open ----CloseGently----> closing ----queue sent----> lingering ----peer closed---> closed
///     |                          |                            |        or kLinger          ^
///     +--------------------------+------- Close, error -------+----------------------------+
///
/// Pending operations keep the connection alive. Memory is bounded by a read buffer, one frame and
/// the SendQueue. Not thread-safe.
class Connection : public Transport::User, public std::enable_shared_from_this<Connection> {
 public:
  using Clock = Traffic::Clock;

  Connection(std::unique_ptr<Transport> transport, const Limits& limits, ThreadMetrics& metrics);

  /// Starts reading. `handler` must stay valid until it is replaced or the connection is closed.
  /// `received` contains bytes that were received before, such as the bytes after Hello.
  void Start(ConnectionHandler* handler, std::span<const std::byte> received = {});
  void set_handler(ConnectionHandler* handler) { handler_ = handler; }

  void SendControl(SharedFrame frame);
  [[nodiscard]] bool SendEvents(SharedFrame frame);
  /// Sends a batch. Returns how many waiting frames of older batches were dropped because the peer
  /// is slow. Over a WebSocket, the batch may wait for `wait_s` seconds, so that several batches
  /// leave in one message. Control messages do not wait. When one is sent, waiting batches leave in
  /// the same write.
  [[nodiscard]] std::size_t SendPoses(PoseFrames&& batch, double wait_s);
  /// Sends movements. The result is that of SendQueue::PushMovements. For `wait_s`, see SendPoses.
  [[nodiscard]] std::size_t SendMovements(WorldId world, int shard, SharedFrame frame,
                                          double wait_s);
  /// Sends batches that wait.
  void EndWait() {
    if (is_waiting_) ScheduleFlush();
  }
  void DropMovements(WorldId world) { queue_.DropMovements(world); }
  void SendTerrain(WorldId world, SharedFrame frame);
  void DropTerrain(WorldId world) { queue_.DropTerrain(world); }
  void DropPoses(WorldId world, protocol::PoseMode mode) { queue_.DropPoses(world, mode); }

  [[nodiscard]] const SendQueue& queue() const { return queue_; }
  [[nodiscard]] TransportKind kind() const { return kind_; }

  /// Stops reading until ResumeReading. TCP flow control then slows down the peer.
  void PauseReading() { is_paused_ = true; }
  void ResumeReading();

  /// Drops waiting poses, sends all other waiting frames and the end of the stream, and closes the
  /// connection when the peer has closed it, at the latest after kLinger. Waiting ensures that the
  /// last message arrives, because closing a socket with unread bytes would discard it. The handler
  /// receives no further calls. A WebSocket sends `code`, unless a bad frame has set another code.
  void CloseGently(CloseCode code = CloseCode::kNormal);
  /// Closes at once.
  void Close();
  [[nodiscard]] bool is_closed() const { return is_closed_; }

  /// Returns the detached transport and closes this connection. Writes the bytes after the last
  /// message to `received`. May be called only from OnMessage, if nothing was sent before.
  [[nodiscard]] std::unique_ptr<Transport> Release(std::vector<std::byte>& received);

 private:
  static constexpr std::chrono::seconds kLinger{2};

  void OnReceived(const boost::system::error_code& error, const Transport::Chunk& chunk) override;
  void OnSent(const boost::system::error_code& error) override;

  void Process();
  [[nodiscard]] Expected<std::optional<protocol::FrameView>> NextFrame();
  [[nodiscard]] Expected<std::optional<protocol::FrameView>> NextFrameOfMessages();
  void Refuse(const Error& error);
  void Read();
  void ScheduleFlush(double wait_s = 0.0);
  void Wait(double wait_s);
  void Flush();
  void Sent();
  void Watch();
  void BeginLinger();

  std::unique_ptr<Transport> transport_;  // Null after Release.
  const TransportKind kind_;
  boost::asio::steady_timer timer_;
  boost::asio::steady_timer wait_timer_;
  const Limits limits_;
  ThreadMetrics& metrics_;
  ConnectionHandler* handler_ = nullptr;

  protocol::FrameReader reader_;
  std::vector<std::byte> read_buffer_;
  std::span<const std::byte> unread_;
  bool is_text_ = false;          // True if the current WebSocket message is a text message.
  bool is_message_over_ = false;  // True if unread_ contains the end of the WebSocket message.
  // A complete frame whose WebSocket message has not ended yet.
  std::optional<protocol::FrameView> whole_;
  std::vector<std::byte> handed_over_;  // The bytes that were passed to Start.
  bool is_reading_ = false;
  bool is_processing_ = false;
  bool is_paused_ = false;

  SendQueue queue_;
  SendQueue::Gathered in_flight_;
  bool is_writing_ = false;
  bool is_flush_scheduled_ = false;
  bool is_urgent_ = false;   // True if a frame in the queue must not wait.
  bool is_waiting_ = false;  // True if frames in the queue wait until wait_until_.
  Clock::time_point wait_until_;
  bool is_closing_ = false;
  bool is_lingering_ = false;
  bool is_closed_ = false;
  Traffic traffic_;
  CloseCode close_code_ = CloseCode::kNormal;
  Clock::time_point closing_since_;
  Clock::time_point kept_alive_;  // Time of the last KeepAlive.
};

}  // namespace stridewire::server
