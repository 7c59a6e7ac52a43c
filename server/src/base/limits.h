#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "stridewire/protocol/limits.h"

namespace stridewire::server {

/// The limits of the server. Each has a key of the same name in section [limits] of the
/// configuration. The metric stridewire_limit_reached_total counts how often limits were reached
/// (see Limit).
struct Limits {
  // Frames.
  std::size_t max_control_bytes = protocol::kMaxControlBytes;  ///< Payload of a control message.
  std::size_t max_bulk_bytes = protocol::kMaxBulkBytes;        ///< Payload of a bulk message.

  // Connections and sessions.
  /// Maximum number of connections whose client has not sent Hello yet.
  int max_handshakes = 256;
  int max_sessions = 1024;  ///< Maximum number of attached and detached sessions.
  /// Maximum number of sessions and handshakes per client address.
  int max_sessions_per_address = 256;
  /// Maximum time from accepting a connection to a complete Hello.
  double handshake_timeout_s = 5.0;
  double idle_timeout_s = 30.0;   ///< Maximum time without received bytes; 0: no timeout.
  double write_timeout_s = 30.0;  ///< Maximum time without progress of a pending write.
  /// Time for which a detached session waits for its client; 0: sessions cannot be resumed.
  double resume_window_s = 60.0;
  /// Maximum time for which a batch of one shard waits for those of other shards, so that they are
  /// sent in one WebSocket message; 0: batches never wait.
  double websocket_gather_s = 0.004;
  int max_http_connections = 64;

  // Worlds and avatars.
  int max_worlds = 256;
  int max_worlds_per_session = 64;
  int max_subscriptions = 64;      ///< Per session.
  int max_named_avatars = 65'536;  ///< Avatar ids in all subscriptions of a session.
  int max_avatars = 65'536;        ///< Maximum number of avatars in all worlds together.
  int max_avatars_per_world = 16'384;
  int max_queue = 256;  ///< Waiting requests per avatar.

  // Commands. These limits apply to each session, except starts_per_tick and spawns_per_tick.
  int requests_per_s = 50'000;  ///< Command items per second; more are rejected.
  int request_burst = 65'536;   ///< Command items that a session may send at once.
  /// Maximum number of avatars that one command starts per tick, on all shards.
  int starts_per_tick = 128;
  /// Maximum number of avatars that one shard spawns per tick, for all sessions.
  int spawns_per_tick = 512;
  /// Messages of any type. If there are more, the server pauses reading.
  int messages_per_s = 4000;
  /// Unanswered commands. When there are this many, the server pauses reading. Also the maximum
  /// number of unanswered InspectAvatar queries.
  int max_pending_commands = 256;

  // Memory of one session.
  /// Outgoing messages except poses, movements and terrain. Movements have a second budget of this
  /// size.
  std::size_t control_buffer_bytes = std::size_t{4} << 20;
  int observer_backlog_ticks = 4;  ///< Pose batches that may wait per world, mode and shard.
  std::size_t reply_cache_bytes = std::size_t{4} << 20;
  /// Maximum total size of the last Events messages, which are stored so that they can be sent
  /// again after a reconnect.
  std::size_t event_replay_bytes = std::size_t{1} << 20;
  /// Value of SO_SNDBUF; 0: the default of the system.
  std::size_t socket_send_buffer_bytes = 0;
};

/// Labels of the metric stridewire_limit_reached_total.
enum class Limit : std::uint8_t {
  kFrameBytes,
  kHandshakes,
  kSessions,
  kSessionsPerAddress,
  kHandshakeTimeout,
  kIdleTimeout,
  kWriteTimeout,
  kResumeWindow,
  kWorlds,
  kWorldsPerSession,
  kSubscriptions,
  kNamedAvatars,
  kAvatars,
  kAvatarsPerWorld,
  kQueue,
  kRequestsPerSecond,
  kStartsPerTick,
  kSpawnsPerTick,
  kMessagesPerSecond,
  kPendingCommands,
  kControlBuffer,
  kObserverBacklog,
  kReplyCache,
  kEventReplay,
  kHttpConnections,
  kHttpWork,
  kCount,
};

/// Values of the metric's label `limit`, indexed by Limit.
inline constexpr std::array<std::string_view, static_cast<std::size_t>(Limit::kCount)> kLimitNames =
    {"frame_bytes",
     "max_handshakes",
     "max_sessions",
     "max_sessions_per_address",
     "handshake_timeout",
     "idle_timeout",
     "write_timeout",
     "resume_window",
     "max_worlds",
     "max_worlds_per_session",
     "max_subscriptions",
     "max_named_avatars",
     "max_avatars",
     "max_avatars_per_world",
     "max_queue",
     "requests_per_s",
     "starts_per_tick",
     "spawns_per_tick",
     "messages_per_s",
     "max_pending_commands",
     "control_buffer",
     "observer_backlog",
     "reply_cache",
     "event_replay",
     "max_http_connections",
     "http_work"};

}  // namespace stridewire::server
