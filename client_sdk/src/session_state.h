#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "backoff.h"
#include "clock_map.h"
#include "event_queue.h"
#include "library_fetch.h"
#include "playout_clock.h"
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
  double recording_s = 0.0;  ///< Length of the recording of each world. 0: none.
  /// Maximum memory of one world's recording.
  std::size_t max_recording_bytes = std::size_t{192} << 20;
  double connect_timeout_s = 5.0;
  double ping_interval_s = 1.0;
  double render_delay_s = -1.0;  ///< Negative: the delay adapts to the link.
  WorldView::Evaluation evaluation = WorldView::Evaluation::kEveryTick;
  bool respawn = false;
  /// True: worlds and subscriptions survive Close, and Open restores them in a new session. Worlds
  /// can be joined, observed and left while the session is closed.
  bool keep_worlds = false;
  /// True: items of replies and events of avatars become events. False: the application reads them
  /// from the messages.
  bool detailed_events = true;
  std::string library_folder;  ///< Folder that caches libraries. Empty: no cache.
  std::uint64_t seed = 1;
};

/// Returns the memory of a terrain in bytes.
[[nodiscard]] std::size_t TerrainBytes(const std::optional<protocol::TerrainInfo>& terrain);

/// The data of a session, and the functions with which the application reads it. SessionCommands
/// and Session build on it.
class SessionState {
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

  /// State of a world. kWanted: JoinWorld has not been sent yet, or has to be sent again. kJoining:
  /// it was sent. kLeft: the application has left the world, and the server has not replied yet.
  enum class WorldState : std::uint8_t { kWanted, kJoining, kJoined, kRefused, kLeft };

  /// While at least this many bytes wait for the socket, no further command is encoded.
  static constexpr std::size_t kMaxOutputBytes = std::size_t{1} << 20;
  static constexpr std::size_t kMaxWorlds = 256;

  explicit SessionState(const SessionOptions& options);

  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] stridewire_status last_status() const { return last_status_; }
  [[nodiscard]] const std::string& last_text() const { return last_text_; }
  [[nodiscard]] EventQueue& events() { return events_; }
  /// Returns null if the world does not exist.
  [[nodiscard]] const WorldView* FindWorld(stridewire_world world) const;
  [[nodiscard]] WorldView* FindWorld(stridewire_world world);
  [[nodiscard]] std::optional<WorldState> FindWorldState(stridewire_world world) const;
  /// Returns the world to which the server has assigned the id `id`, or 0.
  [[nodiscard]] stridewire_world FindHandle(protocol::WorldId id) const;
  /// Returns the last received terrain of an existing world.
  [[nodiscard]] const std::optional<protocol::TerrainInfo>& TerrainOf(
      stridewire_world world) const {
    return worlds_.at(world).terrain;
  }
  [[nodiscard]] const ClockMap& clock() const { return clock_; }
  /// Returns the server time to display at `local_s`. Requires clock().ready().
  [[nodiscard]] double RenderTime(double local_s) const;
  /// Describes the display at `local_s`.
  [[nodiscard]] stridewire_playout Playout(double local_s) const;
  [[nodiscard]] DisplayCounts& displayed() { return displayed_; }
  [[nodiscard]] double tick_hz() const { return tick_hz_; }
  [[nodiscard]] stridewire_statistics Statistics() const;

 protected:
  using CommandMessage =
      std::variant<protocol::JoinWorld, protocol::LeaveWorld, protocol::Spawn, protocol::Remove,
                   protocol::Request, protocol::CancelQueue, protocol::SetTerrain,
                   protocol::SetLayers, protocol::SetPlanting, protocol::Observe,
                   protocol::StopObserving>;

  struct Command {
    std::uint64_t id = 0;
    stridewire_world world = 0;
    bool own = false;  ///< True if the session itself created the command, after a lost session.
    std::size_t bytes = 0;
    CommandMessage message;
  };

  struct Subscription {
    protocol::Observe message;
    bool unsent = true;
  };

  struct World {
    using State = WorldState;
    State state = State::kWanted;
    std::string name;
    protocol::Role role = protocol::Role::kController;
    protocol::WorldId server_id = 0;  ///< 0: unknown.
    std::uint64_t join_command = 0;
    bool join_answered = false;  ///< True if the application has received the REPLY to its join.
    std::deque<Command> unsent;
    std::map<protocol::SubscriptionId, Subscription> subscriptions;
    /// Avatars that this client has spawned, with their last base frames.
    std::map<protocol::AvatarId, protocol::Placement> spawned;
    /// Number of dropped batches in the last Lagging message.
    std::uint64_t last_dropped_batches = 0;
    std::unique_ptr<WorldView> view;
    /// Evaluates poses from movements. Not null while movements are observed.
    std::unique_ptr<ReplicaSet> replicas;
    std::optional<protocol::TerrainInfo> terrain;
  };

  /// Stores the error for last_status and last_text, and returns `status`.
  stridewire_status Refuse(stridewire_status status, std::string_view text);
  /// Returns whether the session is connected or tries to connect.
  [[nodiscard]] bool IsOpen() const;
  World* FindByServerId(protocol::WorldId id, stridewire_world& handle);
  /// Restricts the view of a world to poses of avatars that a subscription covers.
  void UpdateFilter(World& world);
  /// Returns the shortest interval of the subscriptions that receive poses of a mode, or 0 if there
  /// are none.
  [[nodiscard]] static std::uint64_t EveryNTicks(const World& world, protocol::PoseMode mode);
  /// Returns the longest interval of the poses that are observed, in seconds, at most 0.25.
  [[nodiscard]] double PoseIntervalS() const;
  [[nodiscard]] stridewire_event MakeEvent(stridewire_event_type type, stridewire_world world = 0,
                                           stridewire_status status = STRIDEWIRE_OK,
                                           std::string_view text = {}) const;

  /// Reports the result of an inspection with the event REPLY, and forgets the inspection.
  void EndInspection(std::uint64_t nonce, stridewire_status status, std::string_view text = {});

  SessionOptions options_;
  State state_ = State::kIdle;
  stridewire_status last_status_ = STRIDEWIRE_OK;
  std::string last_text_;
  std::uint64_t answered_command_ = 0;  ///< Result of Session::answered_command.
  Backoff backoff_;
  EventQueue events_;
  ClockMap clock_;
  PlayoutClock playout_;
  DisplayCounts displayed_;
  PoseBudget pose_budget_;
  LibraryFetch libraries_;

  std::map<stridewire_world, World> worlds_;
  stridewire_world next_world_ = 1;
  std::uint32_t next_subscription_ = 1;
  std::uint64_t next_command_ = 1;
  std::map<protocol::Seq, Command> unanswered_;
  protocol::Seq resend_from_ = 0;  ///< First command to send again after a resume; 0: none.
  std::size_t command_count_ = 0;  ///< Number of unsent and unanswered commands of the application.
  std::size_t command_bytes_ = 0;

  // The following members are the state of the session on the server.
  bool had_session_ = false;
  /// Secret for resuming the session. Empty if the server has ended the session.
  std::vector<std::byte> resume_token_;
  protocol::Seq next_seq_ = 1;
  std::uint64_t last_events_number_ = 0;
  protocol::ServerLimits limits_;
  double tick_hz_ = 60.0;

  // The following members are the state of the connection.
  std::uint64_t connection_number_ = 0;
  std::vector<std::string> addresses_;
  std::size_t address_ = 0;          ///< Index of the current address.
  std::size_t failed_attempts_ = 0;  ///< Attempts that have failed since the last delay.
  double next_attempt_s_ = 0.0;
  double deadline_s_ = 0.0;  ///< Time at which kConnecting, kGreeting or kClosing times out.
  double ready_s_ = 0.0;
  double heard_s_ = 0.0;
  double next_ping_s_ = 0.0;
  std::uint64_t ping_nonce_ = 0;
  /// Pings of the application without a Pong; at most 64.
  std::set<std::uint64_t> pending_pings_;
  /// Unanswered inspections: nonce and time at which the inspection expires.
  std::map<std::uint64_t, double> inspections_;
  std::optional<protocol::FrameReader> reader_;
  protocol::Encoder encoder_;
  std::vector<std::byte> output_;

  WorldView::Counts counts_;
  std::deque<double> rtts_s_;  ///< Round-trip times of the last 16 pings.
  std::uint64_t bytes_received_ = 0;
  std::uint64_t bytes_sent_ = 0;
  std::uint64_t dropped_batches_ = 0;
  std::uint64_t events_received_ = 0;
  std::uint64_t commands_sent_ = 0;
  std::uint64_t commands_resent_ = 0;
  std::uint64_t connects_ = 0;
  std::uint64_t resumes_ = 0;
  std::uint64_t connect_failures_ = 0;
  std::uint64_t playout_jumps_ = 0;
  /// Running mean of the lateness of messages with poses or movements. The lateness is relative to
  /// the fastest message in the last ClockMap::kWindowS.
  double jitter_s_ = 0.0;
  double worst_jitter_s_ = 0.0;  ///< Largest recent lateness. Expires after ClockMap::kWindowS.
  double worst_jitter_at_s_ = 0.0;
};

}  // namespace stridewire::client
