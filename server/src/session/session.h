#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "session/session_commands.h"
#include "session/session_context.h"
#include "session/session_host.h"
#include "session/session_stream.h"
#include "session/token_bucket.h"

namespace stridewire::server {

/// One client: the worlds that it has joined, its subscriptions and its commands. A session lives
/// on one shard. If its connection is lost, it waits for the client to resume it
/// (STATE_MACHINE.md).
///
///   created --Attach--> attached --connection lost--> detached --resume window over--> ended
///                          |  ^                          |
///                          |  +---------Attach-----------+
///                          +---Goodbye, or the client cannot resume------------------> ended
///
/// The configured limits (Limits) bound the memory of a session, whatever the client does.
class Session : private ConnectionHandler {
 public:
  using Clock = Connection::Clock;

  Session(SessionIdentity identity, SessionHost& host);
  ~Session() override;
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Sets the connection of a client that has sent `hello`, and sends Welcome with this value of
  /// `resumed`. A previous connection is closed. `received` contains the bytes that were received
  /// after Hello.
  void Attach(std::shared_ptr<Connection> connection, const protocol::Hello& hello, bool resumed,
              std::span<const std::byte> received);

  // Results from shards and from the main thread.
  void OnResult(CommandResult&& result);
  void OnJoined(protocol::Seq seq, Outcome<std::shared_ptr<World>>&& outcome);
  void OnInspected(const protocol::AvatarState& state);
  void OnTerrainRefused(protocol::Seq seq, Refusal refusal);

  // Data of the worlds that the session has joined.
  void OnTerrain(WorldId world, const SharedFrame& frame) { stream_.OnTerrain(world, frame); }
  void OnPoses(SharedPoses& poses) { stream_.OnPoses(poses); }
  void OnMovements(SharedMovements& movements) { stream_.OnMovements(movements); }
  void OnStates(const StatesResult& result) { stream_.OnStates(result); }
  void OnEvents(const EventDelivery& delivery) { stream_.OnEvents(delivery); }

  /// Checks timeouts and sends messages that are due. Called several times per second.
  void Housekeep(Clock::time_point now);

  /// Called when the server is shutting down. Closes the connection when no command is pending; the
  /// client may reconnect later. A session without a connection ends.
  void Drain();

  /// Leaves all worlds, closes the connection, and lets the host destroy the session.
  void End();

  [[nodiscard]] bool is_ended() const { return is_ended_; }
  [[nodiscard]] bool is_attached() const { return context_.connection != nullptr; }
  [[nodiscard]] bool is_attached(TransportKind kind) const {
    return is_attached() && context_.connection->kind() == kind;
  }
  /// Returns the part of the session that determines which data it needs from its worlds.
  [[nodiscard]] const SessionStream& stream() const { return stream_; }

 private:
  // ConnectionHandler.
  void OnMessage(protocol::Message&& message) override;
  void OnBadFrame(const Error& error) override;
  void OnSent() override;
  void OnIdle() override;
  void OnStuck() override;
  void OnClosed() override;

  void Inspect(const protocol::InspectAvatar& message);
  void SendLibraryPiece(const protocol::FetchLibrary& message);

  /// Sends a fatal error and closes the connection. The session then waits for its client to
  /// connect again.
  void Fail(protocol::StatusCode code, std::string text, protocol::Seq seq = 0);
  void Detach();
  void UpdatePause();

  SessionContext context_;
  SessionStream stream_;
  SessionCommands commands_;
  std::string client_name_;
  bool is_ended_ = false;
  Clock::time_point detached_since_;
  int pending_inspections_ = 0;
  TokenBucket message_tokens_;
};

}  // namespace stridewire::server
