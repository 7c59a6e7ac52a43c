#include "session/session.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "runtime/skeleton/layer_clip.h"
#include "stridewire/base/version.h"
#include "world/convert.h"

namespace stridewire::server {

using protocol::StatusCode;

Session::Session(SessionIdentity identity, SessionHost& host)
    : context_{.host = host, .identity = std::move(identity), .connection = nullptr, .worlds = {}},
      stream_(context_),
      commands_(context_, stream_),
      message_tokens_(host.config().limits.messages_per_s, host.config().limits.messages_per_s) {
  STRIDEWIRE_CHECK(context_.identity.id != 0);
}

Session::~Session() {
  if (context_.connection != nullptr) context_.connection->set_handler(nullptr);
}

// ---- connection

void Session::Attach(std::shared_ptr<Connection> connection, const protocol::Hello& hello,
                     bool resumed, std::span<const std::byte> received) {
  STRIDEWIRE_CHECK(connection != nullptr && !is_ended_);
  if (context_.connection != nullptr) {
    Fail(StatusCode::kReplaced, "the session was resumed over another connection");
  }
  STRIDEWIRE_CHECK(context_.connection == nullptr);
  const Limits& limits = context_.host.config().limits;
  context_.connection = std::move(connection);
  client_name_ = hello.client_name;

  protocol::Welcome welcome;
  welcome.session = context_.identity.id;
  welcome.resume_token = context_.identity.token;
  welcome.resumed = resumed;
  welcome.last_seq = commands_.last_seq();
  welcome.tick_hz = context_.host.clock().tick_hz();
  welcome.server_name = "stridewired";
  welcome.server_version = kVersion;
  welcome.limits.max_control_bytes = static_cast<std::uint32_t>(limits.max_control_bytes);
  welcome.limits.max_bulk_bytes = static_cast<std::uint32_t>(limits.max_bulk_bytes);
  welcome.limits.max_items = static_cast<std::uint32_t>(SessionCommands::MaxItems(limits));
  welcome.limits.max_avatars_per_world = static_cast<std::uint32_t>(limits.max_avatars_per_world);
  welcome.limits.max_queue = static_cast<std::uint32_t>(limits.max_queue);
  welcome.limits.idle_timeout_s = limits.idle_timeout_s;
  welcome.limits.resume_window_s = limits.resume_window_s;
  context_.Send(welcome);
  for (const auto& [id, membership] : context_.worlds) {
    commands_.SendWorldInfo(0, membership);
    stream_.SendTerrain(*membership.world, true);
  }
  stream_.Resume(hello.last_events_number);
  spdlog::info("session {:016x} {}: client '{}', address {}{}", context_.identity.id,
               resumed ? "resumed" : "opened", client_name_, context_.identity.address,
               is_attached(TransportKind::kWebSocket) ? ", WebSocket" : "");
  context_.connection->Start(this, received);
}

void Session::Detach() {
  if (context_.connection == nullptr) return;
  context_.connection->set_handler(nullptr);
  context_.connection = nullptr;
  context_.host.metrics().connections_closed.Add();
  detached_since_ = Clock::now();
  if (context_.host.config().limits.resume_window_s <= 0.0) {
    End();
    return;
  }
  for (const auto& [id, membership] : context_.worlds) {
    context_.host.InterestChanged(membership.world);
  }
}

void Session::OnClosed() {
  if (context_.connection == nullptr) return;
  spdlog::info("session {:016x} lost its connection", context_.identity.id);
  Detach();
}

void Session::OnSent() {
  UpdatePause();
  stream_.RequestStates();
}

void Session::Fail(StatusCode code, std::string text, protocol::Seq seq) {
  if (context_.connection == nullptr) return;
  spdlog::info("session {:016x}: closing the connection: {}", context_.identity.id, text);
  context_.Send(
      protocol::ErrorNotice{.code = code, .text = std::move(text), .fatal = true, .seq = seq});
  const auto connection = context_.connection;
  // If a new connection replaces this one at once, the session does not become detached.
  if (code == StatusCode::kReplaced) {
    context_.connection = nullptr;
    context_.host.metrics().connections_closed.Add();
  } else {
    Detach();
  }
  connection->CloseGently(CloseCodeOf(code));
}

void Session::OnBadFrame(const Error& error) {
  context_.host.metrics().protocol_errors.Add();
  if (error.code == ErrorCode::kLimitExceeded) {
    context_.host.metrics().Reached(Limit::kFrameBytes);
  }
  Fail(FrameStatusCode(error.code), Describe(error));
}

void Session::OnIdle() {
  context_.host.metrics().Reached(Limit::kIdleTimeout);
  Fail(StatusCode::kTimeout, "no data was received for too long (idle_timeout_s)");
}

void Session::OnStuck() {
  context_.host.metrics().Reached(Limit::kWriteTimeout);
  Fail(StatusCode::kTooSlow, "the client does not read sent data (write_timeout_s)");
}

void Session::Drain() {
  if (context_.connection == nullptr) {
    End();
    return;
  }
  // Pending commands must be answered first. Housekeep calls this function again later.
  if (commands_.pending_count() > 0) return;
  // This is not a Goodbye, so the client may reconnect as soon as a server is available.
  Fail(StatusCode::kShuttingDown, "the server is shutting down");
}

void Session::End() {
  if (is_ended_) return;
  is_ended_ = true;
  while (!context_.worlds.empty()) commands_.Leave(context_.worlds.begin()->first);
  if (context_.connection != nullptr) {
    const auto connection = std::exchange(context_.connection, nullptr);
    context_.host.metrics().connections_closed.Add();
    connection->CloseGently();
  }
  STRIDEWIRE_CHECK(stream_.subscriptions().size() == 0);
  spdlog::info("session {:016x} ended", context_.identity.id);
  context_.host.DestroySession(context_.identity.id);
}

void Session::Housekeep(Clock::time_point now) {
  if (is_ended_) return;
  if (context_.host.is_draining()) {
    Drain();
    return;
  }
  if (context_.connection == nullptr) {
    const double waited_s = std::chrono::duration<double>(now - detached_since_).count();
    if (waited_s >= context_.host.config().limits.resume_window_s) {
      context_.host.metrics().Reached(Limit::kResumeWindow);
      End();
    }
    return;
  }
  for (auto& [id, membership] : context_.worlds) {
    // Waits until all control messages are sent, so that messages do not accumulate if the client
    // does not read them.
    if (context_.connection->queue().control_empty()) stream_.SendLagging(membership);
  }
  UpdatePause();
}

void Session::UpdatePause() {
  if (context_.connection == nullptr) return;
  const Limits& limits = context_.host.config().limits;
  message_tokens_.AdvanceTime(context_.host.clock().ServerTime(Clock::now()));
  const bool is_pending_full =
      commands_.pending_count() >= static_cast<std::size_t>(limits.max_pending_commands) ||
      commands_.pending_items() > protocol::kMaxItems;
  const bool exceeds_rate = message_tokens_.tokens() < 1.0;
  // Replies cannot be dropped, so the session does not read commands until the client has read some
  // replies.
  const bool is_queue_full =
      context_.connection->queue().control_bytes() > limits.control_buffer_bytes / 2;
  if (is_pending_full || exceeds_rate || is_queue_full) {
    context_.connection->PauseReading();
  } else {
    context_.connection->ResumeReading();
  }
}

// ---- results

void Session::OnResult(CommandResult&& result) {
  if (is_ended_) return;
  commands_.OnResult(std::move(result));
  UpdatePause();
}

void Session::OnJoined(protocol::Seq seq, Outcome<std::shared_ptr<World>>&& outcome) {
  if (!is_ended_) {
    commands_.OnJoined(seq, std::move(outcome));
  } else if (outcome) {
    context_.host.SendToServer(LeaveNotice{(*outcome)->id});
  }
}

void Session::OnTerrainRefused(protocol::Seq seq, Refusal refusal) {
  if (is_ended_) return;
  commands_.OnTerrainRefused(seq, std::move(refusal));
  UpdatePause();
}

// ---- messages

void Session::OnMessage(protocol::Message&& message) {
  ThreadMetrics& metrics = context_.host.metrics();
  message_tokens_.AdvanceTime(context_.host.clock().ServerTime(Clock::now()));
  static_cast<void>(message_tokens_.Take(1.0));  // If no token is left, UpdatePause pauses reading.
  std::visit(
      [&]<typename Received>(Received& received) {
        if constexpr (SessionCommands::IsCommand<Received>()) {
          const protocol::Seq seq = received.seq;
          if (auto refusal = commands_.Handle(std::move(received))) {
            metrics.protocol_errors.Add();
            Fail(refusal->code, std::move(refusal->text), seq);
          }
        } else if constexpr (std::is_same_v<Received, protocol::Ping>) {
          context_.Send(
              protocol::Pong{.nonce = received.nonce,
                             .time_s = received.time_s,
                             .server_time_s = context_.host.clock().ServerTime(Clock::now()),
                             .tick = context_.host.tick()});
        } else if constexpr (std::is_same_v<Received, protocol::InspectAvatar>) {
          Inspect(received);
        } else if constexpr (std::is_same_v<Received, protocol::FetchLibrary>) {
          SendLibraryPiece(received);
        } else if constexpr (std::is_same_v<Received, protocol::Goodbye>) {
          spdlog::info("session {:016x}: received Goodbye", context_.identity.id);
          End();
        } else {
          metrics.protocol_errors.Add();
          Fail(StatusCode::kUnexpectedMessage,
               std::string(protocol::MessageTypeName(Received::kType)) +
                   " is not expected in this state");
        }
      },
      message);
  if (context_.connection == nullptr) return;
  if (message_tokens_.tokens() < 1.0) metrics.Reached(Limit::kMessagesPerSecond);
  const auto max_pending =
      static_cast<std::size_t>(context_.host.config().limits.max_pending_commands);
  if (commands_.pending_count() >= max_pending) metrics.Reached(Limit::kPendingCommands);
  UpdatePause();
}

void Session::Inspect(const protocol::InspectAvatar& message) {
  const auto refuse = [&](StatusCode code, const char* text) {
    context_.Send(protocol::AvatarState{.nonce = message.nonce,
                                        .world = message.world,
                                        .avatar = message.avatar,
                                        .code = code,
                                        .text = text});
  };
  const Membership* membership = context_.FindWorld(message.world);
  if (membership == nullptr) {
    refuse(StatusCode::kNotJoined, "this session has not joined that world");
  } else if (pending_inspections_ >= context_.host.config().limits.max_pending_commands) {
    context_.host.metrics().Reached(Limit::kPendingCommands);
    refuse(StatusCode::kLimitReached, "too many pending inspections (max_pending_commands)");
  } else {
    ++pending_inspections_;
    context_.host.SendToShard(ShardOf(message.avatar, context_.host.shard_count()),
                              InspectRequest{.world = membership->world,
                                             .from_shard = context_.host.shard_index(),
                                             .session = context_.identity.id,
                                             .nonce = message.nonce,
                                             .avatar = message.avatar});
  }
}

void Session::OnInspected(const protocol::AvatarState& state) {
  // The request may belong to an ended session, which this session replaces under the same id.
  if (pending_inspections_ == 0) return;
  --pending_inspections_;
  context_.Send(state);
}

void Session::SendLibraryPiece(const protocol::FetchLibrary& message) {
  protocol::LibraryPiece piece{.nonce = message.nonce, .hash = message.hash};
  const auto refuse = [&](StatusCode code, const char* text) {
    piece.code = code;
    piece.text = text;
    context_.Send(piece);
  };
  const auto it = std::ranges::find_if(context_.worlds, [&](const auto& item) {
    return item.second.world->library->hash() == message.hash;
  });
  if (it == context_.worlds.end()) {
    return refuse(StatusCode::kNotJoined, "no world of this session uses this library");
  }
  const std::span<const std::byte> file = it->second.world->library->bytes();
  if (message.offset > file.size()) {
    return refuse(StatusCode::kOutOfRange, "the offset is beyond the end of the library");
  }
  // Room for the other members of the message, in case the frame limit is small.
  constexpr std::size_t kOverheadBytes = 512;
  const std::size_t max_bytes = std::min(
      protocol::kMaxPieceBytes, context_.host.config().limits.max_bulk_bytes - kOverheadBytes);
  const std::span<const std::byte> rest = file.subspan(message.offset);
  const std::span<const std::byte> part =
      rest.first(std::min({rest.size(), max_bytes, std::size_t{message.length}}));
  piece.total_bytes = file.size();
  piece.offset = message.offset;
  piece.bytes.assign(part.begin(), part.end());
  context_.Send(piece);
}

}  // namespace stridewire::server
