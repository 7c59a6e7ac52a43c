#pragma once

#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "net/send_queue.h"
#include "net/transport.h"
#include "ops/limits.h"
#include "ops/metrics.h"
#include "stridewire/protocol/frame_reader.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::server {

/// Who a connection tells what happens on it. Called on the connection's thread.
class ConnectionHandler {
 public:
  virtual ~ConnectionHandler() = default;
  virtual void OnMessage(protocol::Message&& message) = 0;
  /// Bytes that are no message; nothing after them is read.
  virtual void OnBadFrame(const Error& error) = 0;
  /// Something was sent: there is room again.
  virtual void OnSent() {}
  /// Nothing came for idle_timeout_s, or nothing was taken for write_timeout_s.
  virtual void OnIdle() {}
  virtual void OnStuck() {}
  /// The connection is gone. Last call.
  virtual void OnClosed() = 0;
};

/// One connection on one thread: cuts frames out of what comes, sends what waits, and keeps the
/// time. The same over TCP and WebSocket, whose difference is Transport's.
///
/// Lives as long as something is under way on it. Memory is bounded by a read buffer, one frame
/// and the SendQueue. Not thread-safe.
class Connection : public Transport::User, public std::enable_shared_from_this<Connection> {
 public:
  using Clock = Traffic::Clock;

  Connection(std::unique_ptr<Transport> transport, const Limits& limits, ThreadMetrics& metrics);

  /// Begins to read. `handler` is told until it is taken away; `received` came before.
  void Start(ConnectionHandler* handler, std::span<const std::byte> received = {});
  void set_handler(ConnectionHandler* handler) { handler_ = handler; }

  void SendControl(SharedFrame frame);
  [[nodiscard]] bool SendEvents(SharedFrame frame);
  /// Returns how many frames a slow peer lost by it.
  [[nodiscard]] std::size_t SendPoses(const PoseDelivery& delivery);
  /// As SendQueue::PushMovements.
  [[nodiscard]] std::size_t SendMovements(WorldId world, int shard, SharedFrame frame);
  void DropMovements(WorldId world) { queue_.DropMovements(world); }
  void SendTerrain(WorldId world, SharedFrame frame);
  void DropTerrain(WorldId world) { queue_.DropTerrain(world); }
  void DropPoses(WorldId world, protocol::PoseMode mode) { queue_.DropPoses(world, mode); }

  [[nodiscard]] const SendQueue& queue() const { return queue_; }
  [[nodiscard]] TransportKind kind() const { return kind_; }

  /// Stops taking messages until `ResumeReading`; the peer feels it.
  void PauseReading() { is_paused_ = true; }
  void ResumeReading();

  /// Sends what waits (poses apart), then says it is the end, and closes when the peer has, at the
  /// latest after `kLinger`. So a last message arrives: closing with unread bytes would cut it off.
  /// The handler is not called any more. `code` is for a WebSocket; bad frames have their own.
  void CloseGently(CloseCode code = CloseCode::kNormal);
  /// At once.
  void Close();
  [[nodiscard]] bool is_closed() const { return is_closed_; }

  /// Takes the transport out, detached, with what was received behind the last message. Only from
  /// OnMessage, when nothing was sent. The connection is over.
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
  void ScheduleFlush();
  void Flush();
  void Sent();
  void Watch();
  void BeginLinger();

  std::unique_ptr<Transport> transport_;  // none after Release
  const TransportKind kind_;
  boost::asio::steady_timer timer_;
  const Limits limits_;
  ThreadMetrics& metrics_;
  ConnectionHandler* handler_ = nullptr;

  protocol::FrameReader reader_;
  std::vector<std::byte> read_buffer_;
  std::span<const std::byte> unread_;
  bool is_text_ = false;                      // with messages: the one being received
  bool is_message_over_ = false;              // the same: its last bytes are in unread_
  std::optional<protocol::FrameView> whole_;  // the same: all there, but the message goes on
  std::vector<std::byte> handed_over_;        // bytes that came before Start
  bool is_reading_ = false;
  bool is_processing_ = false;
  bool is_paused_ = false;

  SendQueue queue_;
  SendQueue::Gathered in_flight_;
  bool is_writing_ = false;
  bool is_flush_scheduled_ = false;
  bool is_closing_ = false;
  bool is_lingering_ = false;
  bool is_closed_ = false;
  Traffic traffic_;
  CloseCode close_code_ = CloseCode::kNormal;
  Clock::time_point closing_since_;
};

}  // namespace stridewire::server
