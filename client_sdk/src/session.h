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
  std::string library_folder;  ///< Empty: libraries are fetched anew by every client.
  std::uint64_t seed = 1;
};

/// The client's side of protocol/STATE_MACHINE.md, without socket, clock or thread: bytes and times
/// are arguments, so tests replay any order of things.
///
///   kIdle --Open--> kWaiting --StartConnecting--> kConnecting --OnConnected--> kGreeting
///                     ^   ^                            |                          | Welcome
///                     |   +----------- failed ---------+                          v
///                     +------------- lost, or the server ends the session ----- kReady --Close-->
///   kClosed: refused for good.                                                      kClosing --> kIdle
///
/// A command passes through three places: `unsent` of its world (until WorldInfo told the server's
/// number of that world, and while too much is under way), `unanswered_` in order of seq, and its
/// REPLY event. A lost session gives worlds and subscriptions their commands anew, ahead of what
/// had not been sent.
class Session {
 public:
  enum class State : std::uint8_t {
    kIdle,
    kWaiting,     ///< For the next attempt.
    kConnecting,  ///< TCP.
    kGreeting,    ///< Hello sent.
    kReady,
    kClosing,  ///< Goodbye is going out.
    kClosed,
  };

  /// Bytes waiting for the socket above which no further command is encoded.
  static constexpr std::size_t kMaxOutputBytes = std::size_t{1} << 20;
  static constexpr std::size_t kMaxWorlds = 256;
  static constexpr double kGoodbye_s = 1.0;
  /// A connection that was ready for this long starts the back-off afresh.
  static constexpr double kStable_s = 2.0;

  explicit Session(const SessionOptions& options);

  // ---- the caller's side

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
  /// Nullptr: no such world.
  [[nodiscard]] const WorldView* FindWorld(stridewire_world world) const;
  /// The ground of a world that there is, as the server last told.
  [[nodiscard]] const std::optional<protocol::TerrainInfo>& TerrainOf(
      stridewire_world world) const {
    return worlds_.at(world).terrain;
  }
  [[nodiscard]] const ClockMap& clock() const { return clock_; }
  [[nodiscard]] double render_delay_s() const { return options_.render_delay_s; }
  [[nodiscard]] double tick_hz() const { return tick_hz_; }
  [[nodiscard]] stridewire_statistics Statistics() const;

  // ---- the network's side. Times do not go back.

  /// Whether an attempt is due; then call StartConnecting.
  [[nodiscard]] bool ConnectDue(double now_s) const;
  void StartConnecting(double now_s);
  void OnConnected(double now_s);
  void OnBytes(std::span<const std::byte> bytes, double now_s);
  /// The attempt failed or the connection broke.
  void OnLost(stridewire_status status, std::string_view text, double now_s);
  /// Time-outs and pings.
  void AdvanceTime(double now_s);
  /// Whether a socket belongs to this state; if not any more, the network closes it.
  [[nodiscard]] bool NeedsSocket() const;
  /// Grows with every connection, so that late bytes of an old one are told apart.
  [[nodiscard]] std::uint64_t connection_number() const { return connection_number_; }
  /// Work on libraries for who holds no lock (Do), and what came of it.
  [[nodiscard]] std::optional<LibraryTask> TakeLibraryTask() { return libraries_.TakeTask(); }
  void OnLibraryTask(const std::string& hash,
                     Expected<std::shared_ptr<const MotionLibrary>> result);
  /// Takes what is to be written, in place of `bytes`' content; false: nothing.
  [[nodiscard]] bool TakeOutput(std::vector<std::byte>& bytes);
  /// What TakeOutput gave has been written.
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
    bool own = false;  ///< Given by the session itself, after it was lost.
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
    protocol::WorldId server_id = 0;  ///< 0: not known.
    std::uint64_t join_command = 0;
    bool join_answered = false;  ///< The caller has had its REPLY.
    std::deque<Command> unsent;
    std::map<protocol::SubscriptionId, Subscription> subscriptions;
    std::map<protocol::AvatarId, protocol::Placement> spawned;  ///< Ours, and where they are.
    std::uint64_t told_dropped_batches = 0;                     ///< By the last Lagging.
    std::unique_ptr<WorldView> view;
    std::unique_ptr<ReplicaSet> evaluated;  ///< While movements are observed.
    std::optional<protocol::TerrainInfo> terrain;
  };

  /// Refuses a call, remembering why.
  stridewire_status Refuse(stridewire_status status, std::string_view text);
  [[nodiscard]] bool IsOpen() const;
  /// Enqueue, and what can be sent is.
  template <typename Message>
  stridewire_status SendCommand(stridewire_world world, Message message, std::size_t bytes,
                                std::uint64_t& command);
  template <typename Message>
  stridewire_status Enqueue(stridewire_world world, Message message, std::size_t bytes,
                            std::uint64_t& command);
  void UpdateFilter(World& world);
  [[nodiscard]] static std::uint64_t EveryNTicks(const World& world, protocol::PoseMode mode);
  World* FindByServerId(protocol::WorldId id, stridewire_world& handle);

  /// Encodes what may go out now.
  void Pump();
  [[nodiscard]] bool MaySend() const;
  void Send(Command command);
  /// Whether an Observe may go out; it waits for the library its movements are of, or ends here.
  enum class Readiness : std::uint8_t { kReady, kWaits, kRefused };
  Readiness PrepareMovements(World& world, const Command& command);
  void AskForLibraries();
  /// Whether this server knows what it is asked.
  [[nodiscard]] bool Understands(const CommandMessage& message) const;
  void TakeTerrain(stridewire_world handle, const std::optional<protocol::TerrainInfo>& terrain);
  void FailAll(stridewire_status status, std::string_view text);
  void FailUnsent(World& world, stridewire_status status, std::string_view text);
  /// Ends a command: its REPLY (a NOTICE if it was our own and failed), and its place is free.
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
  void Handle(const Message& message, double now_s);  ///< What a server may not send.

  void OnJoinReply(World& world, const protocol::Reply& reply, double now_s);
  void OnSpawnReply(World& world, const protocol::Spawn& spawn, const protocol::Reply& reply);
  void OnRemoveReply(World& world, const protocol::Remove& remove, const protocol::Reply& reply);
  void OnObserveReply(World& world, const protocol::Observe& observe, const protocol::Reply& reply);
  void FollowSpawned(World& world, const protocol::Event& event);
  /// The server knows nothing of us: what is wanted gets its commands anew.
  void StartAnew();
  void ForgetEverything();
  void BreakOff(stridewire_status status, std::string_view text, double now_s);
  void CloseForGood(stridewire_status status, std::string_view text);
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
  protocol::Seq resend_from_ = 0;  ///< Unanswered ones from here on have to go out again; 0: none.
  std::size_t command_count_ = 0;  ///< The caller's, unsent and unanswered.
  std::size_t command_bytes_ = 0;

  // The session as the server knows it.
  bool had_session_ = false;
  std::vector<std::byte> resume_token_;  ///< Empty once the server has ended the session.
  protocol::Seq next_seq_ = 1;
  std::uint64_t last_events_number_ = 0;
  std::uint64_t features_ = 0;
  protocol::ServerLimits limits_;
  double tick_hz_ = 60.0;

  // The connection.
  std::uint64_t connection_number_ = 0;
  double next_attempt_s_ = 0.0;
  double deadline_s_ = 0.0;  ///< Of connecting, greeting or closing.
  double ready_s_ = 0.0;
  double heard_s_ = 0.0;
  double next_ping_s_ = 0.0;
  std::uint64_t ping_nonce_ = 0;
  std::set<std::uint64_t> asked_pings_;  ///< Whose Pong the caller waits for; at most 64.
  std::optional<protocol::FrameReader> reader_;
  protocol::Encoder encoder_;
  std::vector<std::byte> output_;

  WorldView::Counts counts_;
  std::deque<double> rtts_s_;  ///< The last 16.
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
