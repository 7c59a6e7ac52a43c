#pragma once

#include "session_state.h"

namespace stridewire::client {

/// The commands of a session. Checks, queues, sends and ends them.
///
/// A command is first in `unsent` of its world, until the world has a server id and MaySend returns
/// true. It then moves to `unanswered_`, which is in order of sequence numbers, and finally becomes
/// a REPLY event. If the server has lost the session, the client first joins its worlds and
/// subscribes again, and then sends unsent commands.
class SessionCommands : public SessionState {
 public:
  using SessionState::SessionState;

  stridewire_status JoinWorld(std::string_view name, protocol::Role role, stridewire_world& world,
                              std::uint64_t& command);
  stridewire_status LeaveWorld(stridewire_world world, std::uint64_t& command);
  stridewire_status Spawn(stridewire_world world, protocol::Spawn message, std::uint64_t& command);
  stridewire_status Remove(stridewire_world world, protocol::Remove message,
                           std::uint64_t& command);
  stridewire_status Request(stridewire_world world, protocol::Request message,
                            std::uint64_t& command);
  stridewire_status Cancel(stridewire_world world, protocol::CancelQueue message,
                           std::uint64_t& command);
  stridewire_status SetTerrain(stridewire_world world, protocol::SetTerrain message,
                               std::uint64_t& command);
  stridewire_status SetLayers(stridewire_world world, protocol::SetLayers message,
                              std::uint64_t& command);
  stridewire_status SetPlanting(stridewire_world world, protocol::SetPlanting message,
                                std::uint64_t& command);
  stridewire_status Observe(stridewire_world world, protocol::Observe message,
                            std::uint32_t& subscription, std::uint64_t& command);
  stridewire_status MoveRegion(std::uint32_t subscription, protocol::Region region,
                               std::uint64_t& command);
  stridewire_status StopObserving(std::uint32_t subscription, std::uint64_t& command);

  /// Queries the state of an avatar. The event REPLY with the command `nonce` reports the result.
  /// If it is OK, the application reads the AvatarState message. The result is CONNECTION_LOST if
  /// the connection is lost, and TIMEOUT after kInspectTimeoutS. Fails with NOT_READY if there is
  /// no connection or the world is not joined, and with COMMANDS_FULL if kMaxInspections queries
  /// are unanswered.
  stridewire_status Inspect(stridewire_world world, protocol::AvatarId avatar,
                            std::uint64_t& nonce);
  static constexpr double kInspectTimeoutS = 10.0;
  static constexpr std::size_t kMaxInspections = 64;

  /// Returns the next task for RunLibraryTask, if any. Report its result with OnLibraryTask.
  [[nodiscard]] std::optional<LibraryTask> TakeLibraryTask() { return libraries_.TakeTask(); }
  void OnLibraryTask(const std::string& hash,
                     Expected<std::shared_ptr<const MotionLibrary>> result);

 protected:
  /// Calls Enqueue and then sends everything that may be sent.
  template <typename Message>
  stridewire_status SendCommand(stridewire_world world, Message message, std::size_t bytes,
                                std::uint64_t& command);
  /// Checks a command and appends it to the unsent commands of its world.
  template <typename Message>
  stridewire_status Enqueue(stridewire_world world, Message message, std::size_t bytes,
                            std::uint64_t& command);
  /// Executes the last unsent command of a world, which moves or stops a subscription, without the
  /// server, because the client is closed. Changes or removes the unsent Observe of the
  /// subscription, if any. `moved` is the new Observe; null: the subscription was stopped.
  void ChangeWhileClosed(World& world, std::uint32_t subscription, const protocol::Observe* moved);
  /// Encodes all commands that may be sent now.
  void Pump();
  /// Returns true if the output buffer has room and the server can store another reply.
  [[nodiscard]] bool MaySend() const;
  void Send(Command command);
  /// Determines whether a command may be sent. An Observe of movements waits for its library. If
  /// the library is not available, this function answers the command.
  enum class Readiness : std::uint8_t { kReady, kWaits, kAnswered };
  Readiness PrepareMovements(World& world, const Command& command);
  void RequestLibraries();
  void FailAll(stridewire_status status, std::string_view text);
  void FailUnsent(World& world, stridewire_status status, std::string_view text);
  /// Ends a command with a REPLY event, or with a NOTICE event if the session created it and it
  /// failed.
  void Answer(const Command& command, stridewire_status status, std::string_view text = {},
              std::uint32_t accepted = 0);
};

}  // namespace stridewire::client
