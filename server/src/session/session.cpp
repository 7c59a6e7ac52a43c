#include "session/session.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "base/check.h"
#include "runtime/skeleton/layer_clip.h"
#include "session/encode_frame.h"
#include "stridewire/base/version.h"
#include "world/convert.h"

namespace stridewire::server {

using protocol::PoseMode;
using protocol::Reply;
using protocol::Seq;
using protocol::StatusCode;

Session::Session(SessionIdentity identity, SessionHost& host)
    : identity_(std::move(identity)),
      host_(host),
      replies_(protocol::kReplyCache, host.config().limits.reply_memory_bytes),
      event_replay_(host.config().limits.event_replay_bytes),
      request_tokens_(host.config().limits.requests_per_s, host.config().limits.request_burst),
      message_tokens_(host.config().limits.messages_per_s, host.config().limits.messages_per_s) {}

Session::~Session() {
  if (connection_ != nullptr) connection_->set_handler(nullptr);
}

// ---- connection

void Session::Attach(std::shared_ptr<Connection> connection, const protocol::Hello& hello,
                     bool resumed, std::span<const std::byte> received) {
  if (connection_ != nullptr) {
    Fail(StatusCode::kReplaced, "the session goes on over another connection");
  }
  const Limits& limits = host_.config().limits;
  connection_ = std::move(connection);
  client_name_ = hello.client_name;
  std::uint64_t offered = kServerFeatures;
  if (limits.resume_window_s <= 0.0) offered &= ~protocol::kFeatureResume;
  features_ = hello.features & offered;
  constexpr std::uint64_t kCompact = protocol::kFeatureQuantised | protocol::kFeatureCompact;
  subscriptions_.SetCompact((features_ & kCompact) == kCompact,
                            (features_ & protocol::kFeatureDetail) != 0);

  protocol::Welcome welcome;
  welcome.protocol = std::min(hello.protocol_max, protocol::kProtocolMax);
  welcome.features = features_;
  welcome.session = identity_.id;
  welcome.resume_token = identity_.token;
  welcome.resumed = resumed;
  welcome.last_seq = replies_.last_seq();
  welcome.tick_hz = host_.clock().tick_hz();
  welcome.server_name = "stridewired";
  welcome.server_version = kVersion;
  welcome.limits.max_control_bytes = static_cast<std::uint32_t>(limits.max_control_bytes);
  welcome.limits.max_bulk_bytes = static_cast<std::uint32_t>(limits.max_bulk_bytes);
  welcome.limits.max_items = static_cast<std::uint32_t>(MaxItems(limits));
  welcome.limits.max_avatars_per_world = static_cast<std::uint32_t>(limits.max_avatars_per_world);
  welcome.limits.max_queue = static_cast<std::uint32_t>(limits.max_queue);
  welcome.limits.idle_timeout_s = limits.idle_timeout_s;
  welcome.limits.resume_window_s = limits.resume_window_s;
  Send(welcome);
  for (auto& [id, membership] : worlds_) {
    SendWorldInfo(0, membership);
    SendTerrain(*membership.world, true);
  }

  subscriptions_.TellAnew();
  // Whatever was on its way when the connection broke goes out again.
  event_replay_.ForEachAfter(hello.last_events_number, [this](EventReplay::Kept& kept) {
    kept.was_sent = connection_->SendEvents(kept.frame);
    if (!kept.was_sent) host_.metrics().events_dropped.Add(kept.events);
  });
  for (auto& [id, membership] : worlds_) {
    membership.told_dropped = 0;
    SendLagging(membership);
  }
  movement_feeds_.clear();
  for (auto& [id, membership] : worlds_) {
    host_.InterestChanged(membership.world);
    if (subscriptions_.Watches(id, PoseMode::kMovement)) WatchMovements(membership.world);
  }
  spdlog::info("session {:016x} of '{}' ({}{}) {}", identity_.id, client_name_, identity_.address,
               connection_->kind() == TransportKind::kWebSocket ? ", WebSocket" : "",
               resumed ? "goes on" : "begins");
  connection_->Start(this, received);
}

void Session::Detach() {
  if (connection_ == nullptr) return;
  connection_->set_handler(nullptr);
  connection_ = nullptr;
  host_.metrics().connections_closed.Add();
  detached_since_ = Clock::now();
  if ((features_ & protocol::kFeatureResume) == 0) {
    End();
    return;
  }
  for (auto& [id, membership] : worlds_) host_.InterestChanged(membership.world);
}

void Session::OnClosed() {
  if (connection_ == nullptr) return;
  spdlog::info("session {:016x} lost its connection", identity_.id);
  Detach();
}

void Session::Fail(StatusCode code, std::string text, Seq seq) {
  if (connection_ == nullptr) return;
  spdlog::info("session {:016x}: {}", identity_.id, text);
  Send(protocol::ErrorNotice{.code = code, .text = std::move(text), .fatal = true, .seq = seq});
  const auto connection = connection_;
  // A connection that makes room for the next one leaves the session attached in all but name.
  if (code == StatusCode::kReplaced) {
    connection_ = nullptr;
    host_.metrics().connections_closed.Add();
  } else {
    Detach();
  }
  connection->CloseGently(CloseCodeOf(code));
}

void Session::OnBadFrame(const Error& error) {
  host_.metrics().protocol_errors.Add();
  if (error.code == ErrorCode::kLimitExceeded) host_.metrics().Reached(Limit::kFrameBytes);
  Fail(FrameStatusCode(error.code), Describe(error));
}

void Session::OnIdle() {
  host_.metrics().Reached(Limit::kIdleTimeout);
  Fail(StatusCode::kTimeout, "nothing was heard for too long");
}

void Session::OnStuck() {
  host_.metrics().Reached(Limit::kWriteTimeout);
  Fail(StatusCode::kTooSlow, "what was sent is not being read");
}

void Session::Drain() {
  if (connection_ == nullptr) {
    End();
    return;
  }
  // What was taken on is answered first; Housekeep comes back to it.
  if (!pending_.empty()) return;
  // Not a Goodbye: the client may come back as soon as there is a server again.
  Fail(StatusCode::kShuttingDown, "the server is shutting down");
}

void Session::End() {
  if (is_ended_) return;
  is_ended_ = true;
  while (!worlds_.empty()) Leave(worlds_.begin()->first);
  if (connection_ != nullptr) {
    const auto connection = std::exchange(connection_, nullptr);
    host_.metrics().connections_closed.Add();
    connection->CloseGently();
  }
  spdlog::info("session {:016x} ends", identity_.id);
  host_.SessionEnded(identity_.id);
}

void Session::Housekeep(Clock::time_point now) {
  if (is_ended_) return;
  if (host_.is_draining()) {
    Drain();
    return;
  }
  const Limits& limits = host_.config().limits;
  if (connection_ == nullptr) {
    const double waited_s = std::chrono::duration<double>(now - detached_since_).count();
    if (waited_s >= limits.resume_window_s) {
      host_.metrics().Reached(Limit::kResumeWindow);
      End();
    }
    return;
  }
  for (auto& [id, membership] : worlds_) {
    // One at a time, so that a peer that reads nothing does not pile them up.
    if (connection_->queue().control_empty()) SendLagging(membership);
  }
  UpdatePause();
}

void Session::UpdatePause() {
  if (connection_ == nullptr) return;
  const Limits& limits = host_.config().limits;
  message_tokens_.AdvanceTime(host_.clock().ServerTime(Clock::now()));
  const bool is_pending_full =
      pending_.size() >= static_cast<std::size_t>(limits.max_pending_commands) ||
      pending_items_ > protocol::kMaxItems;
  const bool is_too_chatty = message_tokens_.tokens() < 1.0;
  // Replies cannot be dropped, so commands wait until the peer has read some.
  const bool is_unread = connection_->queue().control_bytes() > limits.control_buffer_bytes / 2;
  if (is_pending_full || is_too_chatty || is_unread) {
    connection_->PauseReading();
  } else {
    connection_->ResumeReading();
  }
}

// ---- messages

void Session::OnMessage(protocol::Message&& message) {
  ThreadMetrics& metrics = host_.metrics();
  message_tokens_.AdvanceTime(host_.clock().ServerTime(Clock::now()));
  static_cast<void>(message_tokens_.Take(1.0));  // UpdatePause sees to it that there is one
  std::visit(
      [&]<typename Arrived>(Arrived& arrived) {
        if constexpr (requires { this->Execute(std::move(arrived)); }) {
          Handle(std::move(arrived));
        } else if constexpr (std::is_same_v<Arrived, protocol::Ping>) {
          Send(protocol::Pong{.nonce = arrived.nonce,
                              .time_s = arrived.time_s,
                              .server_time_s = host_.clock().ServerTime(Clock::now()),
                              .tick = host_.tick()});
        } else if constexpr (std::is_same_v<Arrived, protocol::InspectAvatar>) {
          Inspect(arrived);
        } else if constexpr (std::is_same_v<Arrived, protocol::FetchLibrary>) {
          Fetch(arrived);
        } else if constexpr (std::is_same_v<Arrived, protocol::Goodbye>) {
          spdlog::info("session {:016x}: its client says goodbye", identity_.id);
          End();
        } else {
          metrics.protocol_errors.Add();
          Fail(StatusCode::kUnexpectedMessage,
               std::string(protocol::MessageTypeName(Arrived::kType)) +
                   " is not expected in this state");
        }
      },
      message);
  if (connection_ == nullptr) return;
  if (message_tokens_.tokens() < 1.0) metrics.Reached(Limit::kMessagesPerSecond);
  if (pending_.size() >= static_cast<std::size_t>(host_.config().limits.max_pending_commands)) {
    metrics.Reached(Limit::kPendingCommands);
  }
  UpdatePause();
}

template <typename Command>
void Session::Handle(Command command) {
  const Seq seq = command.seq;
  switch (replies_.Classify(seq)) {
    case ReplyCache::Verdict::kNew: break;
    case ReplyCache::Verdict::kPending: return;
    case ReplyCache::Verdict::kAnswered: {
      const ReplyCache::Answer& answer = replies_.Find(seq);
      if (const auto it = worlds_.find(answer.joined); it != worlds_.end()) {
        SendWorldInfo(seq, it->second);
        SendTerrain(*it->second.world, false);
      }
      connection_->SendControl(answer.reply);
      return;
    }
    case ReplyCache::Verdict::kForgotten:
      Send(Reply{.seq = seq,
                 .code = StatusCode::kForgotten,
                 .text = "it was done so long ago that the answer is not kept"});
      return;
    case ReplyCache::Verdict::kGap:
      host_.metrics().protocol_errors.Add();
      Fail(StatusCode::kBadSequence, "a command before this one is missing", seq);
      return;
  }
  replies_.Take(seq);
  if (host_.is_draining()) {
    Answer(seq, StatusCode::kShuttingDown, "the server is shutting down");
    return;
  }
  Execute(std::move(command));
}

void Session::Execute(protocol::JoinWorld&& command) {
  const Limits& limits = host_.config().limits;
  if (worlds_.size() >= static_cast<std::size_t>(limits.max_worlds_per_session)) {
    host_.metrics().Reached(Limit::kWorldsPerSession);
    Answer(command.seq, StatusCode::kLimitReached, "the session is in as many worlds as it may");
    return;
  }
  Pending& pending = pending_[command.seq];
  pending.outstanding = 1;
  pending.role = command.role;
  host_.JoinWorld(identity_.id, command.seq, std::move(command.name));
}

void Session::OnJoined(Seq seq, Outcome<std::shared_ptr<World>>&& outcome) {
  const auto it = pending_.find(seq);
  if (is_ended_ || it == pending_.end()) {
    if (outcome) host_.LeaveWorld((*outcome)->id);
    return;
  }
  const protocol::Role role = it->second.role;
  pending_.erase(it);
  if (!outcome) {
    Answer(seq, outcome.error().code, std::move(outcome.error().text));
    return;
  }
  const std::shared_ptr<World> world = *std::move(outcome);
  if (worlds_.contains(world->id)) {
    host_.LeaveWorld(world->id);
    Answer(seq, StatusCode::kAlreadyJoined, "the session is in that world already");
    return;
  }
  if (worlds_.size() >= static_cast<std::size_t>(host_.config().limits.max_worlds_per_session)) {
    host_.metrics().Reached(Limit::kWorldsPerSession);
    host_.LeaveWorld(world->id);
    Answer(seq, StatusCode::kLimitReached, "the session is in as many worlds as it may");
    return;
  }
  const auto& membership =
      worlds_.emplace(world->id, Membership{.world = world, .role = role}).first->second;
  host_.InterestChanged(world);
  SendWorldInfo(seq, membership);
  SendTerrain(*world, false);
  Answer(Reply{.seq = seq}, world->id);
}

void Session::Execute(protocol::LeaveWorld&& command) {
  if (!worlds_.contains(command.world)) {
    Answer(command.seq, StatusCode::kNotJoined, "this session is not in that world");
    return;
  }
  Leave(command.world);
  Answer(command.seq, StatusCode::kOk);
}

void Session::Leave(WorldId id) {
  const auto it = worlds_.find(id);
  const std::shared_ptr<World> world = it->second.world;
  const bool is_controller = it->second.role == protocol::Role::kController;
  worlds_.erase(it);
  subscriptions_.RemoveWorld(id);
  EndMovements(id);
  if (connection_ != nullptr) {
    for (const PoseMode mode : kSentModes) connection_->DropPoses(id, mode);
    connection_->DropTerrain(id);
  }
  if (is_controller) {
    for (int shard = 0; shard < host_.shard_count(); ++shard) {
      host_.Submit(shard, {.world = world,
                           .from_shard = host_.shard_index(),
                           .session = identity_.id,
                           .seq = 0,
                           .part = ReleasePart{}});
    }
  }
  host_.InterestChanged(world);
  host_.LeaveWorld(id);
}

void Session::Execute(protocol::Observe&& command) {
  const bool has_ring_details = command.region && !command.region->ring_details.empty();
  if ((command.detail != protocol::PoseDetail::kAll || has_ring_details) &&
      !subscriptions_.has_detail()) {
    Answer(
        command.seq, StatusCode::kUnsupported,
        "the features 'compact poses' and 'levels of detail' were not agreed on in the handshake");
    return;
  }
  command.mode = subscriptions_.SentMode(command.mode, command.detail);
  const auto it = worlds_.find(command.world);
  if (it == worlds_.end()) {
    Answer(command.seq, StatusCode::kNotJoined, "this session is not in that world");
    return;
  }
  if (command.region && (features_ & protocol::kFeatureRegions) == 0) {
    Answer(command.seq, StatusCode::kUnsupported,
           "the feature 'regions' was not agreed on in the handshake");
    return;
  }
  if (command.replace) {
    MoveRegion(command, it->second.world);
    return;
  }
  if (subscriptions_.Contains(command.subscription)) {
    Answer(command.seq, StatusCode::kSubscriptionExists, "a subscription has that number already");
    return;
  }
  if (subscriptions_.size() >= static_cast<std::size_t>(host_.config().limits.max_subscriptions)) {
    host_.metrics().Reached(Limit::kSubscriptions);
    Answer(command.seq, StatusCode::kLimitReached,
           "the session has as many subscriptions as it may");
    return;
  }
  if (command.mode == PoseMode::kMovement && (features_ & protocol::kFeatureMovementMode) == 0) {
    Answer(command.seq, StatusCode::kUnsupported,
           "the feature 'movement mode' was not agreed on in the handshake");
    return;
  }
  if (command.mode == PoseMode::kQuantised && (features_ & protocol::kFeatureQuantised) == 0) {
    Answer(command.seq, StatusCode::kUnsupported,
           "the feature 'quantised poses' was not agreed on in the handshake");
    return;
  }
  if (command.region ? subscriptions_.WatchesWorld(command.world)
                     : subscriptions_.HasRegion(command.world)) {
    Answer(command.seq, StatusCode::kNotAllowed,
           "a region is all that a session observes of a world");
    return;
  }
  const auto max_named = static_cast<std::size_t>(host_.config().limits.max_named_avatars);
  if (subscriptions_.named_count() + command.avatars.size() > max_named) {
    host_.metrics().Reached(Limit::kNamedAvatars);
    Answer(command.seq, StatusCode::kLimitReached,
           "the session's subscriptions name as many avatars as they may");
    return;
  }
  if (!Affords(command.seq, command.avatars.size())) return;
  std::optional<RegionMembers> region;
  if (command.region) {
    region.emplace().Move(*command.region, it->second.world->interest_cell_m, command.every_n_ticks,
                          command.mode);
  }
  subscriptions_.Add(command.subscription, {.world = command.world,
                                            .mode = command.mode,
                                            .every_n_ticks = command.every_n_ticks,
                                            .with_events = command.with_events,
                                            .avatars = std::move(command.avatars),
                                            .region = std::move(region)});
  host_.InterestChanged(it->second.world);
  Answer(command.seq, StatusCode::kOk);
  if (command.mode == PoseMode::kMovement) WatchMovements(it->second.world);
}

void Session::MoveRegion(const protocol::Observe& command, const std::shared_ptr<World>& world) {
  const auto every = [&] {
    std::array<PoseInterest::Every, kSentModes.size()> all;
    for (const PoseMode mode : kSentModes) all[ModeIndex(mode)] = EveryOf(command.world, mode);
    return all;
  };
  const auto before = every();
  const bool had_events = WantsEvents(command.world);
  if (!subscriptions_.MoveRegion(command.subscription, command, world->interest_cell_m)) {
    Answer(command.seq, StatusCode::kNoSuchSubscription,
           "no region of that number, world and mode is observed");
    return;
  }
  if (every() == before && WantsEvents(command.world) == had_events) {
    host_.RegionMoved(command.world);
  } else {
    host_.InterestChanged(world);
  }
  Answer(command.seq, StatusCode::kOk);
}

void Session::Execute(protocol::StopObserving&& command) {
  const auto stopped = subscriptions_.Remove(command.subscription);
  if (!stopped) {
    Answer(command.seq, StatusCode::kNoSuchSubscription, "no subscription of that number");
    return;
  }
  const WorldId world = stopped->world;
  if (stopped->mode == PoseMode::kMovement) {
    if (!subscriptions_.Watches(world, PoseMode::kMovement)) {
      EndMovements(world);
    } else {
      WatchMovements(worlds_.at(world).world);
    }
  } else if (connection_ != nullptr) {
    for (const PoseMode mode : kSentModes) {
      if (!subscriptions_.Watches(world, mode)) connection_->DropPoses(world, mode);
    }
  }
  host_.InterestChanged(worlds_.at(world).world);
  Answer(command.seq, StatusCode::kOk);
}

// ---- what the server sends

void Session::Answer(Seq seq, StatusCode code, std::string text) {
  Answer(Reply{.seq = seq, .code = code, .text = std::move(text)});
}

void Session::Answer(Reply&& reply, WorldId joined) {
  const SharedFrame frame = EncodeFrame(host_.encoder(), reply);
  STRIDEWIRE_CHECK(frame != nullptr);  // MaxItems sees to it that a Reply fits
  const std::size_t forgotten = replies_.Remember(reply.seq, frame, joined);
  if (forgotten > 0 && replies_.bytes() > host_.config().limits.reply_memory_bytes / 2) {
    host_.metrics().Reached(Limit::kReplyCache, forgotten);
  }
  if (connection_ != nullptr) connection_->SendControl(frame);
}

void Session::SendWorldInfo(Seq seq, const Membership& membership) {
  const World& world = *membership.world;
  std::vector<std::string> layers;
  if ((features_ & protocol::kFeatureLayers) != 0) {
    for (const LayerClip& layer : world.library->layers()) layers.emplace_back(layer.name);
  }
  std::vector<RotationQuantization> codes;
  std::vector<std::uint16_t> fewer_joints;
  if ((features_ & protocol::kFeatureCompact) != 0) {
    codes = world.codes->joints;
    if ((features_ & protocol::kFeatureDetail) != 0) fewer_joints = world.codes->fewer_joints;
  }
  Send(protocol::WorldInfo{.seq = seq,
                           .world = world.id,
                           .name = world.name,
                           .role = membership.role,
                           .tick = host_.tick(),
                           .library_hash = world.library->hash(),
                           .skeleton = ToWire(world.library->skeleton()),
                           .layers = std::move(layers),
                           .rotation_codes = std::move(codes),
                           .fewer_joints = std::move(fewer_joints)});
}

void Session::SendTerrain(const World& world, bool also_flat) {
  if (connection_ == nullptr || (features_ & protocol::kFeatureTerrain) == 0) return;
  if (const auto ground = world.ground.Get()) {
    connection_->SendTerrain(world.id, ground->frame);
  } else if (also_flat) {
    Send(protocol::WorldTerrain{.world = world.id, .terrain = {}});
  }
}

void Session::SendLagging(Membership& membership) {
  const std::uint64_t dropped = membership.dropped_batches + membership.dropped_events;
  if (connection_ == nullptr || dropped == membership.told_dropped) return;
  membership.told_dropped = dropped;
  Send(protocol::Lagging{.world = membership.world->id,
                         .dropped_batches = membership.dropped_batches,
                         .dropped_events = membership.dropped_events});
}

}  // namespace stridewire::server
