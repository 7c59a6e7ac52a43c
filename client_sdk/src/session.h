#pragma once

#include <span>

#include "session_commands.h"

namespace stridewire::client {

/// The client's side of protocol/STATE_MACHINE.md. It has no socket, clock or thread: bytes and
/// times are arguments, so that tests can replay any sequence.
///
///   kIdle --Open--> kWaiting --StartConnecting--> kConnecting --OnConnected--> kGreeting
///                     ^   ^                            |                          | Welcome
///                     |   +----------- failed ---------+                          v
///                     +------------- lost, or the server ends the session ----- kReady
///                                                                                  | Close
///   kClosed: the server refused the client permanently.                            v
///                                                                   kIdle <--- kClosing
class Session : public SessionCommands {
 public:
  /// Maximum time for sending Goodbye, in seconds.
  static constexpr double kGoodbyeS = 1.0;
  /// If a connection was ready for at least this time, in seconds, the delays before attempts to
  /// reconnect start again with the shortest one (Backoff::Reset).
  static constexpr double kStableS = 2.0;

  using SessionCommands::SessionCommands;

  // ---- The application calls these functions.

  /// Starts connecting. `addresses` contains the address of each server as text, for events and
  /// error messages only. The caller itself connects to the address with the index address_index().
  /// An empty list means that there is one address, which no text mentions.
  stridewire_status Open(double now_s, std::vector<std::string> addresses = {});
  void Close(double now_s);
  stridewire_status Ping(double now_s);

  // ---- The network thread calls these functions, with times that never decrease.

  /// Returns whether to start an attempt to connect, with StartConnecting.
  [[nodiscard]] bool ConnectDue(double now_s) const;
  void StartConnecting(double now_s);
  /// Returns the index of the address for the attempt that StartConnecting has begun.
  [[nodiscard]] std::size_t address_index() const { return address_; }
  void OnConnected(double now_s);
  void OnBytes(std::span<const std::byte> bytes, double now_s);
  /// Same as OnBytes for a message of a WebSocket. It must contain one frame, or several of types
  /// PoseBatch and Movements. No frame may continue in the next message.
  void OnMessage(std::span<const std::byte> message, double now_s);
  /// Returns the command or inspection of the application that the frame of the last OnMessage
  /// answered. Returns 0 for other frames, and for a Reply to a command of the session itself.
  [[nodiscard]] std::uint64_t answered_command() const { return answered_command_; }
  /// Must be called when the attempt to connect has failed or the connection was lost.
  void OnLost(stridewire_status status, std::string_view text, double now_s);
  /// Handles timeouts and sends pings.
  void AdvanceTime(double now_s);
  /// Returns the time at which ConnectDue or AdvanceTime has to be called next. Infinity: never.
  [[nodiscard]] double NextTime() const;
  /// Returns whether the state needs a socket. If not, the network thread closes it.
  [[nodiscard]] bool NeedsSocket() const;
  /// Increases with every connection, so that late results of an old connection are recognized.
  [[nodiscard]] std::uint64_t connection_number() const { return connection_number_; }
  /// Number of bytes that TakeOutput would return without sending further commands.
  [[nodiscard]] std::size_t output_bytes() const { return output_.size(); }
  /// Moves the pending output to `bytes`. Returns false if there is none.
  [[nodiscard]] bool TakeOutput(std::vector<std::byte>& bytes);
  /// Must be called when the bytes from the last TakeOutput have been written.
  void OnOutputWritten();

 private:
  /// Returns whether the session expects messages from the server.
  [[nodiscard]] bool Receives() const;
  /// Decodes and handles a frame. Returns false if that has ended the connection.
  bool HandleFrame(const protocol::FrameView& frame, double now_s);
  void SetTerrainOf(stridewire_world handle, const std::optional<protocol::TerrainInfo>& terrain);
  void Handle(const protocol::Welcome& message, double now_s);
  void Handle(const protocol::WorldInfo& message, double now_s);
  void Handle(const protocol::Reply& message, double now_s);
  void Handle(const protocol::PoseBatch& message, double now_s);
  void Handle(const protocol::Events& message, double now_s);
  void Handle(const protocol::Lagging& message, double now_s);
  void Handle(const protocol::ErrorNotice& message, double now_s);
  void Handle(const protocol::Pong& message, double now_s);
  void Handle(const protocol::WorldTerrain& message, double now_s);
  void Handle(const protocol::Movements& message, double now_s);
  void Handle(const protocol::LibraryPiece& message, double now_s);
  void Handle(const protocol::AvatarState& message, double now_s);
  void Handle(const protocol::Goodbye& message, double now_s);
  /// Rejects messages that a server must not send.
  template <typename Message>
  void Handle(const Message& message, double now_s);

  [[nodiscard]] static bool IsExpected(const Command& command, const protocol::ReplyItem& item);
  void OnJoinReply(World& world, const protocol::Reply& reply, double now_s);
  void OnSpawnReply(World& world, const protocol::Spawn& spawn, const protocol::Reply& reply);
  void OnRemoveReply(World& world, const protocol::Remove& remove, const protocol::Reply& reply);
  void OnObserveReply(World& world, const protocol::Observe& observe, const protocol::Reply& reply);
  void FollowSpawned(World& world, const protocol::Event& event);
  /// Called when a new session has begun. Queues the commands that restore worlds and
  /// subscriptions.
  void RestoreSession();
  void Reset();
  /// Discards everything that the server has sent about a world. The world is joined again later.
  void ResetWorld(stridewire_world handle, World& world);
  /// Called when the session has ended, after all commands were answered. Discards the worlds, or
  /// with SessionOptions::keep_worlds only what the server has sent about them.
  void DetachWorlds();
  void LoseConnection(stridewire_status status, std::string_view text, double now_s);
  /// Ends all inspections, because the connection is lost.
  void EndInspections();
  /// Chooses the address and the time of the next attempt to connect.
  void ScheduleAttempt(bool was_ready, bool server_leaves, double now_s);
  /// Returns the text of the current address. Returns an empty string if there is no address.
  [[nodiscard]] std::string_view AddressText() const;
  void CloseWithError(stridewire_status status, std::string_view text);
  void SendPing(double now_s);
  void SchedulePing(double now_s);
  /// Updates the clocks and the statistics of jitter after a message with poses.
  void FollowPoses(double server_time_s, double now_s);
};

}  // namespace stridewire::client
