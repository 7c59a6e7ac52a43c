#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "stridewire/protocol/limits.h"

namespace stridewire::server {

/// What bounds the server. Each has a key of the same name in section [limits] of the
/// configuration, a default, and a counter stridewire_limit_reached_total{limit="…"}.
struct Limits {
  // Frames.
  std::size_t max_control_bytes = protocol::kMaxControlBytes;  ///< Payload of a small message.
  std::size_t max_bulk_bytes = protocol::kMaxBulkBytes;        ///< Payload of a crowd or batch.

  // Connections and sessions.
  int max_handshakes = 256;            ///< Connections that have not said Hello yet.
  int max_sessions = 1024;             ///< Attached and detached ones.
  int max_sessions_per_address = 256;  ///< The same of one address; handshakes count, too.
  double handshake_timeout_s = 5.0;
  double idle_timeout_s = 30.0;   ///< Silence after which a connection is closed; 0: never.
  double write_timeout_s = 30.0;  ///< No byte taken by the peer for so long: closed.
  double resume_window_s = 60.0;  ///< How long a session waits for its client; 0: not at all.

  // Worlds and avatars.
  int max_worlds = 256;
  int max_worlds_per_session = 64;
  int max_subscriptions = 64;      ///< Of one session.
  int max_named_avatars = 65'536;  ///< In the lists of all its subscriptions.
  int max_avatars = 65'536;
  int max_avatars_per_world = 16'384;
  int max_queue = 256;  ///< Requests waiting, per avatar.

  // What one session may ask for.
  int requests_per_s = 50'000;     ///< Items of commands; more are refused.
  int request_burst = 65'536;      ///< How many at once.
  int starts_per_tick = 128;       ///< Avatars a command sets going in one tick, of all shards.
  int spawns_per_tick = 512;       ///< Avatars a shard makes in one tick, of all sessions.
  int messages_per_s = 4000;       ///< Messages of any kind; beyond, reading pauses.
  int max_pending_commands = 256;  ///< Not answered yet; beyond, reading pauses.

  // Memory of one session.
  std::size_t control_buffer_bytes =
      std::size_t{4} << 20;        ///< Waiting to be sent, poses apart; movements as much again.
  int observer_backlog_ticks = 4;  ///< Batches a world, mode and shard keep for a slow observer.
  std::size_t reply_memory_bytes = std::size_t{4} << 20;
  std::size_t event_replay_bytes = std::size_t{1} << 20;  ///< Events kept for a lost connection.
  std::size_t socket_send_buffer_bytes = 0;               ///< SO_SNDBUF; 0: the system's choice.

  int max_http_connections = 64;
};

/// Names of what counts in stridewire_limit_reached_total.
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
     "reply_memory",
     "event_replay",
     "max_http_connections",
     "http_work"};

}  // namespace stridewire::server
