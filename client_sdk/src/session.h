#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "backoff.h"
#include "clock_map.h"
#include "event_queue.h"
#include "library_fetch.h"
#include "stridewire/client.h"
#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/frame_reader.h"
#include "stridewire/protocol/messages.h"
#include "world_view.h"

namespace stridewire::client {

/// Options of a session; see stridewire_client_options.
struct SessionOptions {
  std::string client_name = "stridewire-client";
  std::string auth_token;
  std::size_t max_events = 65'536;
  std::size_t max_commands = 4096;
  std::size_t max_command_bytes = std::size_t{64} << 20;
  std::size_t pose_history = 32;
  std::size_t max_pose_bytes = std::size_t{256} << 20;
  double connect_timeout_s = 5.0;
  double ping_interval_s = 1.0;
  double render_delay_s = 0.1;
  bool respawn = false;
  std::string library_folder;  ///< Cache of libraries. Empty: no cache.
  std::uint64_t seed = 1;
};

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
///
/// A command is first in `unsent` of its world, until the world has a server id and the output
/// buffer has room. Then it is in `unanswered_`, in order of seq, and finally it becomes a REPLY
/// event. After a lost session, the session joins its worlds and subscribes again before it sends
/// unsent commands.
class Session {
 public:
  enum class State : std::uint8_t {
    kIdle,
    kWaiting,     ///< Waits for the next attempt to connect.
    kConnecting,  ///< The TCP connection is being established.
    kGreeting,    ///< Hello was sent; Welcome is expected.
    kReady,       ///< The handshake is complete.
    kClosing,     ///< Goodbye is being sent.
    kClosed,
  };

  /// While more bytes than this wait for the socket, no further command is encoded.
  static constexpr std::size_t kMaxOutputBytes = std::size_t{1} << 20;
  static constexpr std::size_t kMaxWorlds = 256;
  /// Longest time to send Goodbye, in seconds.
  static constexpr double kGoodbye_s = 1.0;
  /// If a connection was ready for this time, the back-off starts again with its shortest delay.
  static constexpr double kStable_s = 2.0;

  explicit Session(const SessionOptions& options);

  // ---- called by the application

  stridewire_status Open(double now_s);
  void Close(double now_s);
  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] stridewire_status last_status() const { return last_status_; }
  [[nodiscard]] const std::string& last_text() const { return last_text_; }

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
  stridewire_status Ping(double now_s);

  [[nodiscard]] EventQueue& events() { return events_; }
  /// Returns null if the world does not exist.
  [[nodiscard]] const WorldView* FindWorld(stridewire_world world) const;
  /// Returns the terrain of an existing world, as last received.
  [[nodiscard]] const std::optional<protocol::TerrainInfo>& TerrainOf(
      stridewire_world world) const {
    return worlds_.at(world).terrain;
  }
  [[nodiscard]] const ClockMap& clock() const { return clock_; }
  [[nodiscard]] double render_delay_s() const { return options_.render_delay_s; }
  [[nodiscard]] double tick_hz() const { return tick_hz_; }
  [[nodiscard]] stridewire_statistics Statistics() const;

  // ---- called by the network thread. Times never decrease.

  /// Returns whether to start an attempt to connect, with StartConnecting.
  [[nodiscard]] bool ConnectDue(double now_s) const;
  void StartConnecting(double now_s);
  void OnConnected(double now_s);
  void OnBytes(std::span<const std::byte> bytes, double now_s);
  /// The attempt to connect has failed, or the connection was lost.
  void OnLost(stridewire_status status, std::string_view text, double now_s);
  /// Handles timeouts and sends pings.
  void AdvanceTime(double now_s);
  /// Returns whether the state needs a socket. If not, the network thread closes it.
  [[nodiscard]] bool NeedsSocket() const;
  /// Increases with every connection, so that late results of an old connection are recognized.
  [[nodiscard]] std::uint64_t connection_number() const { return connection_number_; }
  /// Returns the next task for RunLibraryTask, if any. Report its result with OnLibraryTask.
  [[nodiscard]] std::optional<LibraryTask> TakeLibraryTask() { return libraries_.TakeTask(); }
  void OnLibraryTask(const std::string& hash,
                     Expected<std::shared_ptr<const MotionLibrary>> result);
  /// Moves the pending output to `bytes`. Returns false if there is none.
  [[nodiscard]] bool TakeOutput(std::vector<std::byte>& bytes);
  /// The bytes from the last TakeOutput were written.
  void OnOutputWritten();

 private:
  using CommandMessage =
      std::variant<protocol::JoinWorld, protocol::LeaveWorld, protocol::Spawn, protocol::Remove,
                   protocol::Request, protocol::CancelQueue, protocol::SetTerrain,
                   protocol::SetLayers, protocol::SetPlanting, protocol::Observe,
                   protocol::StopObserving>;

  struct Command {
    std::uint64_t id = 0;
    stridewire_world world = 0;
    bool own = false;  ///< The session created it after a lost session.
    std::size_t bytes = 0;
    CommandMessage message;
  };

  struct Subscription {
    protocol::Observe message;
    bool unsent = true;
  };

  struct World {
    enum class State : std::uint8_t { kWanted, kJoining, kJoined, kRefused, kLeft };
    State state = State::kWanted;
    std::string name;
    protocol::Role role = protocol::Role::kController;
    protocol::WorldId server_id = 0;  ///< 0: unknown.
    std::uint64_t join_command = 0;
    bool join_answered = false;  ///< The application has received its REPLY.
    std::deque<Command> unsent;
    std::map<protocol::SubscriptionId, Subscription> subscriptions;
    std::map<protocol::AvatarId, protocol::Placement>
        spawned;                             ///< Own avatars with their last base frames.
    std::uint64_t last_dropped_batches = 0;  ///< Count in the last Lagging.
    std::unique_ptr<WorldView> view;
    std::unique_ptr<ReplicaSet> replicas;  ///< Not null while movements are observed.
    std::optional<protocol::TerrainInfo> terrain;
  };

  /// Stores the error for last_error and returns `status`.
  stridewire_status Refuse(stridewire_status status, std::string_view text);
  [[nodiscard]] bool IsOpen() const;
  /// Calls Enqueue and then sends what can be sent.
  template <typename Message>
  stridewire_status SendCommand(stridewire_world world, Message message, std::size_t bytes,
                                std::uint64_t& command);
  /// Checks a command and appends it to the unsent commands of its world.
  template <typename Message>
  stridewire_status Enqueue(stridewire_world world, Message message, std::size_t bytes,
                            std::uint64_t& command);
  void UpdateFilter(World& world);
  [[nodiscard]] static std::uint64_t EveryNTicks(const World& world, protocol::PoseMode mode);
  World* FindByServerId(protocol::WorldId id, stridewire_world& handle);

  /// Encodes all commands that may be sent now.
  void Pump();
  [[nodiscard]] bool MaySend() const;
  void Send(Command command);
  /// Returns whether a command may be sent. An Observe of movements waits for its library, or is
  /// answered here if the library is not available.
  enum class Readiness : std::uint8_t { kReady, kWaits, kAnswered };
  Readiness PrepareMovements(World& world, const Command& command);
  void RequestLibraries();
  void SetTerrainOf(stridewire_world handle, const std::optional<protocol::TerrainInfo>& terrain);
  void FailAll(stridewire_status status, std::string_view text);
  void FailUnsent(World& world, stridewire_status status, std::string_view text);
  /// Ends a command with a REPLY event, or with a NOTICE event if the session created it and it
  /// failed.
  void Answer(const Command& command, stridewire_status status, std::string_view text = {},
              std::uint32_t accepted = 0);

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
  void Handle(const protocol::Goodbye& message, double now_s);
  template <typename Message>
  void Handle(const Message& message, double now_s);  ///< Messages that a server must not send.

  void OnJoinReply(World& world, const protocol::Reply& reply, double now_s);
  void OnSpawnReply(World& world, const protocol::Spawn& spawn, const protocol::Reply& reply);
  void OnRemoveReply(World& world, const protocol::Remove& remove, const protocol::Reply& reply);
  void OnObserveReply(World& world, const protocol::Observe& observe, const protocol::Reply& reply);
  void FollowSpawned(World& world, const protocol::Event& event);
  /// A new session has begun. Queues the commands that restore worlds and subscriptions.
  void RestoreSession();
  void Reset();
  void LoseConnection(stridewire_status status, std::string_view text, double now_s);
  void CloseWithError(stridewire_status status, std::string_view text);
  void SendPing(double now_s);
  [[nodiscard]] stridewire_event MakeEvent(stridewire_event_type type, stridewire_world world = 0,
                                           stridewire_status status = STRIDEWIRE_OK,
                                           std::string_view text = {}) const;

  SessionOptions options_;
  State state_ = State::kIdle;
  stridewire_status last_status_ = STRIDEWIRE_OK;
  std::string last_text_;
  Backoff backoff_;
  EventQueue events_;
  ClockMap clock_;
  PoseBudget pose_budget_;
  LibraryFetch libraries_;

  std::map<stridewire_world, World> worlds_;
  stridewire_world next_world_ = 1;
  std::uint32_t next_subscription_ = 1;
  std::uint64_t next_command_ = 1;
  std::map<protocol::Seq, Command> unanswered_;
  protocol::Seq resend_from_ = 0;  ///< First command to send again after a resume; 0: none.
  std::size_t command_count_ = 0;  ///< Unsent and unanswered commands of the application.
  std::size_t command_bytes_ = 0;

  // State of the session on the server.
  bool had_session_ = false;
  std::vector<std::byte> resume_token_;  ///< Empty if the server has ended the session.
  protocol::Seq next_seq_ = 1;
  std::uint64_t last_events_number_ = 0;
  protocol::ServerLimits limits_;
  double tick_hz_ = 60.0;

  // State of the connection.
  std::uint64_t connection_number_ = 0;
  double next_attempt_s_ = 0.0;
  double deadline_s_ = 0.0;  ///< Timeout of kConnecting, kGreeting and kClosing.
  double ready_s_ = 0.0;
  double heard_s_ = 0.0;
  double next_ping_s_ = 0.0;
  std::uint64_t ping_nonce_ = 0;
  std::set<std::uint64_t> pending_pings_;  ///< Pings of the application without Pong; at most 64.
  std::optional<protocol::FrameReader> reader_;
  protocol::Encoder encoder_;
  std::vector<std::byte> output_;

  WorldView::Counts counts_;
  std::deque<double> rtts_s_;  ///< Of the last 16 pings.
  std::uint64_t bytes_received_ = 0;
  std::uint64_t bytes_sent_ = 0;
  std::uint64_t dropped_batches_ = 0;
  std::uint64_t events_received_ = 0;
  std::uint64_t commands_sent_ = 0;
  std::uint64_t commands_resent_ = 0;
  std::uint64_t connects_ = 0;
  std::uint64_t resumes_ = 0;
  std::uint64_t connect_failures_ = 0;
};

}  // namespace stridewire::client
