#include "session/session.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>
#include <utility>

#include "session/encode_frame.h"
#include "stridewire/base/check.h"
#include "stridewire/base/version.h"
#include "world/convert.h"
#include "world/pose_frames.h"

namespace stridewire::server {

using protocol::PoseMode;
using protocol::Reply;
using protocol::ReplyItem;
using protocol::Seq;
using protocol::StatusCode;

namespace {

// What one of the requests needs and this client has not agreed on; null: nothing.
const char* FeatureMissing(const std::vector<protocol::RequestItem>& items,
                           std::uint64_t features) {
  for (const protocol::RequestItem& item : items) {
    const auto* step = std::get_if<protocol::StepMovement>(&item.movement);
    const bool is_walk = std::holds_alternative<protocol::WalkMovement>(item.movement);
    if (step != nullptr && step->at && (features & protocol::kFeatureFootprints) == 0) {
      return "footprints";
    }
    if (is_walk && (features & protocol::kFeatureWalks) == 0) return "walks";
    if (item.takeover != protocol::Takeover::kNone &&
        (features & protocol::kFeatureTakeovers) == 0) {
      return "takeovers";
    }
    if (step != nullptr && step->must_be_met && (features & protocol::kFeatureRefusals) == 0) {
      return "refusals";
    }
  }
  return nullptr;
}

// An event takes under 512 bytes of a frame, so this many stay below the smallest frame limit.
constexpr std::size_t kEventsPerFrame = 100;
// A refused item takes under 256 bytes of a Reply; with no more items a Reply always fits.
constexpr std::size_t kReplyItemBytes = 256;
// Heights and boxes of a terrain that count as one item: the largest is then half a burst.
constexpr std::size_t kNumbersPerItem = 32;

std::size_t MaxItems(const Limits& limits) {
  return std::min(protocol::kMaxItems, limits.max_bulk_bytes / kReplyItemBytes);
}

template <typename Function>
void ForEachEventFrame(const EventDelivery& delivery, Function&& function) {
  const std::vector<protocol::Event>& events = *delivery.events;
  for (std::size_t first = 0; first < events.size(); first += kEventsPerFrame) {
    const std::size_t count = std::min(kEventsPerFrame, events.size() - first);
    protocol::Events message;
    message.world = delivery.world;
    message.tick = delivery.tick;
    message.events.assign(events.begin() + static_cast<std::ptrdiff_t>(first),
                          events.begin() + static_cast<std::ptrdiff_t>(first + count));
    function(std::move(message));
  }
}

}  // namespace

const std::vector<SharedFrame>& SharedEvents::frames() {
  if (frames_.empty()) {
    ForEachEventFrame(delivery_, [this](protocol::Events&& message) {
      if (auto frame = EncodeFrame(encoder_, message)) frames_.push_back(std::move(frame));
    });
  }
  return frames_;
}

Session::Session(SessionIdentity identity, SessionHost& host)
    : identity_(std::move(identity)),
      host_(host),
      replies_(protocol::kReplyMemory, host.config().limits.reply_memory_bytes),
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
    SendGround(*membership.world, true);
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
  switch (replies_.Judge(seq)) {
    case ReplyMemory::Verdict::kNew: break;
    case ReplyMemory::Verdict::kPending: return;
    case ReplyMemory::Verdict::kAnswered: {
      const ReplyMemory::Answer& answer = replies_.Find(seq);
      if (const auto it = worlds_.find(answer.joined); it != worlds_.end()) {
        SendWorldInfo(seq, it->second);
        SendGround(*it->second.world, false);
      }
      connection_->SendControl(answer.reply);
      return;
    }
    case ReplyMemory::Verdict::kForgotten:
      Send(Reply{.seq = seq,
                 .code = StatusCode::kForgotten,
                 .text = "it was done so long ago that the answer is not kept"});
      return;
    case ReplyMemory::Verdict::kGap:
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

bool Session::Affords(Seq seq, std::size_t item_count) {
  const Limits& limits = host_.config().limits;
  if (item_count > MaxItems(limits)) {
    host_.metrics().Reached(Limit::kFrameBytes);
    Answer(seq, StatusCode::kLimitReached, "more items than one message may have here");
    return false;
  }
  request_tokens_.AdvanceTime(host_.clock().ServerTime(Clock::now()));
  if (request_tokens_.Take(static_cast<double>(item_count))) return true;
  host_.metrics().Reached(Limit::kRequestsPerSecond);
  host_.metrics().requests_rejected.Add(item_count);
  Answer(seq, StatusCode::kLimitReached, "more items a second than a session may send");
  return false;
}

Session::Membership* Session::Commanding(Seq seq, WorldId world) {
  const auto it = worlds_.find(world);
  if (it == worlds_.end()) {
    Answer(seq, StatusCode::kNotJoined, "this session is not in that world");
    return nullptr;
  }
  if (it->second.role != protocol::Role::kController) {
    Answer(seq, StatusCode::kNotAllowed, "an observer commands nothing");
    return nullptr;
  }
  return &it->second;
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
  SendGround(*world, false);
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
    connection_->DropGround(id);
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

template <typename Part>
void Session::SubmitParts(Seq seq, const std::shared_ptr<World>& world, std::vector<Part>&& parts,
                          Pending&& pending) {
  const auto is_empty = [](const Part& part) {
    if constexpr (requires { part.items; }) {
      return part.items.empty();
    } else {
      return part.avatars.empty();
    }
  };
  for (const Part& part : parts) {
    if (!is_empty(part)) ++pending.outstanding;
  }
  pending.reply.seq = seq;
  if (pending.outstanding == 0) {
    Answer(std::move(pending.reply));
    return;
  }
  pending_items_ += pending.item_count;
  pending_.emplace(seq, std::move(pending));
  for (std::size_t shard = 0; shard < parts.size(); ++shard) {
    if (is_empty(parts[shard])) continue;
    host_.Submit(static_cast<int>(shard), {.world = world,
                                           .from_shard = host_.shard_index(),
                                           .session = identity_.id,
                                           .seq = seq,
                                           .part = std::move(parts[shard])});
  }
}

void Session::Execute(protocol::Spawn&& command) {
  const Membership* membership = Commanding(command.seq, command.world);
  if (membership == nullptr || !Affords(command.seq, command.items.size())) return;
  World& world = *membership->world;
  std::vector<SpawnPart> parts(static_cast<std::size_t>(host_.shard_count()));
  Pending pending{.item_count = command.items.size(), .reply = {}};
  std::uint32_t index = 0;
  for (protocol::SpawnItem& item : command.items) {
    ReplyItem refused{.index = index, .avatar = item.avatar, .code = StatusCode::kLimitReached};
    switch (host_.avatar_budget().Reserve(world)) {
      case AvatarBudget::Verdict::kOk:
        if (item.avatar != 0) {
          NoteNumber(world, item.avatar);
        } else {
          item.avatar = NextNumber(world);
        }
        if (item.avatar == 0) {
          host_.avatar_budget().Release(world);
          refused.text = "no avatar number is left";
          pending.reply.items.push_back(std::move(refused));
        } else {
          parts[static_cast<std::size_t>(ShardOf(item.avatar, host_.shard_count()))]
              .items.push_back({index, item});
        }
        break;
      case AvatarBudget::Verdict::kWorldFull:
        host_.metrics().Reached(Limit::kAvatarsPerWorld);
        refused.text = "the world has as many avatars as it takes";
        pending.reply.items.push_back(std::move(refused));
        break;
      case AvatarBudget::Verdict::kServerFull:
        host_.metrics().Reached(Limit::kAvatars);
        refused.text = "the server has as many avatars as it takes";
        pending.reply.items.push_back(std::move(refused));
        break;
    }
    ++index;
  }
  SubmitParts(command.seq, membership->world, std::move(parts), std::move(pending));
}

void Session::Execute(protocol::Request&& command) {
  const Membership* membership = Commanding(command.seq, command.world);
  if (membership == nullptr || !Affords(command.seq, command.items.size())) return;
  if (const char* feature = FeatureMissing(command.items, features_)) {
    Answer(command.seq, StatusCode::kUnsupported,
           std::string("the feature '") + feature + "' was not agreed on in the handshake");
    return;
  }
  // Movements of one avatar stand beside each other.
  std::size_t avatars = 0;
  for (std::size_t i = 0; i < command.items.size(); ++i) {
    avatars += i == 0 || command.items[i].avatar != command.items[i - 1].avatar;
  }
  const auto at_once = static_cast<std::size_t>(host_.config().limits.starts_per_tick);
  const auto over_ticks = static_cast<std::uint32_t>((avatars + at_once - 1) / at_once);
  std::vector<RequestPart> parts(static_cast<std::size_t>(host_.shard_count()),
                                 RequestPart{.items = {}, .over_ticks = over_ticks});
  const std::size_t item_count = command.items.size();
  // Numbers in a row are shared out evenly.
  for (RequestPart& part : parts) part.items.reserve(item_count / parts.size() + 1);
  std::uint32_t index = 0;
  for (protocol::RequestItem& item : command.items) {
    parts[static_cast<std::size_t>(ShardOf(item.avatar, host_.shard_count()))].items.push_back(
        {index++, std::move(item)});
  }
  SubmitParts(command.seq, membership->world, std::move(parts),
              Pending{.item_count = item_count, .reply = {}});
}

void Session::Execute(protocol::SetLayers&& command) {
  const Membership* membership = Commanding(command.seq, command.world);
  if (membership == nullptr || !Affords(command.seq, command.items.size())) return;
  if ((features_ & protocol::kFeatureLayers) == 0) {
    Answer(command.seq, StatusCode::kUnsupported,
           "the feature 'layers' was not agreed on in the handshake");
    return;
  }
  const std::size_t item_count = command.items.size();
  std::vector<LayerPart> parts(static_cast<std::size_t>(host_.shard_count()));
  std::uint32_t index = 0;
  for (protocol::LayerItem& item : command.items) {
    parts[static_cast<std::size_t>(ShardOf(item.avatar, host_.shard_count()))].items.push_back(
        {index++, std::move(item)});
  }
  SubmitParts(command.seq, membership->world, std::move(parts),
              Pending{.item_count = item_count, .reply = {}});
}

void Session::Inspect(const protocol::InspectAvatar& question) {
  if ((features_ & protocol::kFeatureInspect) == 0) {
    host_.metrics().protocol_errors.Add();
    Fail(StatusCode::kUnexpectedMessage, "InspectAvatar needs the feature 'inspect'");
    return;
  }
  const auto refuse = [&](StatusCode code, const char* text) {
    Send(protocol::AvatarState{.nonce = question.nonce,
                               .world = question.world,
                               .avatar = question.avatar,
                               .code = code,
                               .text = text});
  };
  const auto it = worlds_.find(question.world);
  if (it == worlds_.end()) {
    refuse(StatusCode::kNotJoined, "this session is not in that world");
  } else if (pending_questions_ >= host_.config().limits.max_pending_commands) {
    host_.metrics().Reached(Limit::kPendingCommands);
    refuse(StatusCode::kLimitReached, "as many questions wait for their answer as may");
  } else {
    ++pending_questions_;
    host_.Ask(ShardOf(question.avatar, host_.shard_count()), {.world = it->second.world,
                                                              .from_shard = host_.shard_index(),
                                                              .session = identity_.id,
                                                              .nonce = question.nonce,
                                                              .avatar = question.avatar});
  }
}

void Session::OnInspected(const protocol::AvatarState& state) {
  --pending_questions_;
  const auto is_walk = [](const protocol::RequestItem& item) {
    return std::holds_alternative<protocol::WalkMovement>(item.movement);
  };
  if ((features_ & protocol::kFeatureWalks) != 0 || std::ranges::none_of(state.queue, is_walk)) {
    Send(state);
    return;
  }
  protocol::AvatarState without = state;
  std::erase_if(without.queue, is_walk);
  Send(without);
}

template <typename Part>
void Session::SubmitAvatars(Seq seq, WorldId world, const std::vector<AvatarNumber>& avatars,
                            const Part& empty) {
  const Membership* membership = Commanding(seq, world);
  if (membership == nullptr || !Affords(seq, avatars.size())) return;
  std::vector<Part> parts(static_cast<std::size_t>(host_.shard_count()), empty);
  std::uint32_t index = 0;
  for (const AvatarNumber avatar : avatars) {
    parts[static_cast<std::size_t>(ShardOf(avatar, host_.shard_count()))].avatars.push_back(
        {index++, avatar});
  }
  SubmitParts(seq, membership->world, std::move(parts),
              Pending{.item_count = avatars.size(), .reply = {}});
}

void Session::Execute(protocol::Remove&& command) {
  SubmitAvatars<RemovePart>(command.seq, command.world, command.avatars);
}

void Session::Execute(protocol::CancelQueue&& command) {
  SubmitAvatars<CancelPart>(command.seq, command.world, command.avatars);
}

void Session::Execute(protocol::SetPlanting&& command) {
  if ((features_ & protocol::kFeaturePlanting) == 0) {
    Answer(command.seq, StatusCode::kUnsupported,
           "the feature 'planting' was not agreed on in the handshake");
    return;
  }
  SubmitAvatars(command.seq, command.world, command.avatars, PlantingPart{{}, !command.is_off});
}

void Session::Execute(protocol::SetTerrain&& command) {
  const Membership* membership = Commanding(command.seq, command.world);
  if (membership == nullptr) return;
  if ((features_ & protocol::kFeatureTerrain) == 0) {
    Answer(command.seq, StatusCode::kUnsupported,
           "the feature 'terrain' was not agreed on in the handshake");
    return;
  }
  // What it costs to make and to tell, in items.
  std::size_t numbers = 0;
  if (command.terrain) {
    numbers = command.terrain->boxes.size();
    if (const auto& field = command.terrain->height_field) numbers += field->heights_m.size();
  }
  const std::size_t item_count = 1 + numbers / kNumbersPerItem;
  if (!Affords(command.seq, item_count)) return;
  Pending pending{.outstanding = host_.shard_count(), .item_count = item_count, .reply = {}};
  pending.reply.seq = command.seq;
  pending.reply.accepted = 1;
  pending_items_ += item_count;
  pending_.emplace(command.seq, std::move(pending));
  host_.SetTerrain({.world = membership->world,
                    .from_shard = host_.shard_index(),
                    .session = identity_.id,
                    .seq = command.seq,
                    .terrain = std::move(command.terrain)});
}

void Session::OnTerrainRefused(Seq seq, Refusal refusal) {
  const auto it = pending_.find(seq);
  if (is_ended_ || it == pending_.end()) return;
  pending_items_ -= it->second.item_count;
  pending_.erase(it);
  Answer(seq, refusal.code, std::move(refusal.text));
  UpdatePause();
}

void Session::OnGround(WorldId world, const SharedFrame& frame) {
  if (connection_ == nullptr || (features_ & protocol::kFeatureTerrain) == 0) return;
  if (worlds_.contains(world)) connection_->SendGround(world, frame);
}

void Session::OnResult(CommandResult&& result) {
  const auto it = pending_.find(result.seq);
  if (is_ended_ || it == pending_.end()) return;
  Pending& pending = it->second;
  pending.reply.accepted += result.accepted;
  std::ranges::move(result.items, std::back_inserter(pending.reply.items));
  if (--pending.outstanding > 0) return;
  // Shards answer in any order.
  std::ranges::sort(pending.reply.items, {}, &ReplyItem::index);
  Reply reply = std::move(pending.reply);
  pending_items_ -= pending.item_count;
  pending_.erase(it);
  Answer(std::move(reply));
  UpdatePause();
}

void Session::Execute(protocol::Observe&& command) {
  if (command.detail != protocol::PoseDetail::kAll &&
      subscriptions_.SentMode(command.mode, command.detail) !=
          protocol::CompactMode(command.detail)) {
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
  if (command.region && command.mode == PoseMode::kMovement) {
    Answer(command.seq, StatusCode::kUnsupported, "movements are not told of regions");
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
    region.emplace().Move(*command.region, it->second.world->interest_cell_m,
                          command.every_n_ticks);
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
  const PoseInterest::Every before = EveryOf(command.world, command.mode);
  const bool had_events = WantsEvents(command.world);
  if (!subscriptions_.MoveRegion(command.subscription, command, world->interest_cell_m)) {
    Answer(command.seq, StatusCode::kNoSuchSubscription,
           "no region of that number, world and mode is observed");
    return;
  }
  if (EveryOf(command.world, command.mode) == before && WantsEvents(command.world) == had_events) {
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
  const auto [world, mode] = *stopped;
  const bool is_last = !subscriptions_.Watches(world, mode);
  if (mode == PoseMode::kMovement) {
    if (is_last) {
      EndMovements(world);
    } else {
      WatchMovements(worlds_.at(world).world);
    }
  } else if (is_last && connection_ != nullptr) {
    connection_->DropPoses(world, mode);
  }
  host_.InterestChanged(worlds_.at(world).world);
  Answer(command.seq, StatusCode::kOk);
}

// ---- what the server sends

template <typename Message>
void Session::Send(const Message& message) {
  if (connection_ == nullptr) return;
  if (auto frame = EncodeFrame(host_.encoder(), message)) {
    connection_->SendControl(std::move(frame));
  }
}
template void Session::Send(const protocol::LibraryPiece& message);

void Session::Answer(Seq seq, StatusCode code, std::string text) {
  Answer(Reply{.seq = seq, .code = code, .text = std::move(text)});
}

void Session::Answer(Reply&& reply, WorldId joined) {
  const SharedFrame frame = EncodeFrame(host_.encoder(), reply);
  STRIDEWIRE_CHECK(frame != nullptr);  // MaxItems sees to it that a Reply fits
  const std::size_t forgotten = replies_.Remember(reply.seq, frame, joined);
  if (forgotten > 0 && replies_.bytes() > host_.config().limits.reply_memory_bytes / 2) {
    host_.metrics().Reached(Limit::kReplyMemory, forgotten);
  }
  if (connection_ != nullptr) connection_->SendControl(frame);
}

void Session::SendWorldInfo(Seq seq, const Membership& membership) {
  const World& world = *membership.world;
  std::vector<std::string> layers;
  if ((features_ & protocol::kFeatureLayers) != 0) {
    for (const LayerClip& layer : world.library->layers()) layers.emplace_back(layer.name);
  }
  std::vector<RotationCode> codes;
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

void Session::SendGround(const World& world, bool also_flat) {
  if (connection_ == nullptr || (features_ & protocol::kFeatureTerrain) == 0) return;
  if (const auto ground = world.ground.Get()) {
    connection_->SendGround(world.id, ground->frame);
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

bool Session::WantsEvents(WorldId world) const {
  // Without a connection they are only of use to be sent again later.
  if (connection_ == nullptr && (features_ & protocol::kFeatureEventReplay) == 0) return false;
  const auto it = worlds_.find(world);
  if (it == worlds_.end()) return false;
  if (it->second.role == protocol::Role::kController) return true;
  return subscriptions_.WithEvents(world);
}

PoseInterest::Every Session::EveryOf(WorldId world, PoseMode mode) const {
  return connection_ == nullptr ? PoseInterest::Every{} : subscriptions_.EveryOf(world, mode);
}

std::span<const AvatarNumber> Session::Named(WorldId world, PoseMode mode) const {
  return connection_ == nullptr ? std::span<const AvatarNumber>()
                                : subscriptions_.Named(world, mode);
}

std::optional<RegionReach> Session::ReachOf(WorldId world, PoseMode mode) const {
  return connection_ == nullptr ? std::nullopt : subscriptions_.ReachOf(world, mode);
}

PoseDelivery SharedPoses::Compose(std::span<const std::uint32_t> rows, bool is_partial) {
  PoseDelivery some{.world = delivery_.world,
                    .mode = delivery_.mode,
                    .from_shard = delivery_.from_shard,
                    .tick = delivery_.tick,
                    .avatar_count = static_cast<std::uint32_t>(rows.size()),
                    .parts = ComposeFrames(composer_, *delivery_.rows, rows, is_partial, metrics_),
                    .rows = nullptr,
                    .places = nullptr};
  metrics_.batches_composed.Add(some.parts.size());
  return some;
}

const PoseDelivery& SharedPoses::ComposeShared(std::span<const std::uint32_t> rows) {
  const auto [it, is_new] =
      shared_.try_emplace(std::vector<std::uint32_t>(rows.begin(), rows.end()));
  if (is_new) it->second = Compose(rows, true);
  return it->second;
}

void Session::OnPoses(SharedPoses& poses) {
  if (connection_ == nullptr) return;
  const PoseDelivery& delivery = poses.delivery();
  switch (subscriptions_.ShareOf(delivery)) {
    case Subscriptions::Share::kNone: return;
    case Subscriptions::Share::kWhole:
      // None: the shard has not heard yet that a whole batch is wanted.
      if (!delivery.parts.empty()) SendPoses(delivery);
      return;
    case Subscriptions::Share::kSome:
      if (const auto picked = subscriptions_.Pick(delivery)) {
        SendPoses(poses.Compose(*picked, false));
      }
      return;
    case Subscriptions::Share::kRegion:
      if (delivery.places == nullptr) return;  // the same
      const RegionMembers::Change change = subscriptions_.UpdateRegion(delivery);
      TellRegion(delivery, change);
      if (!change.due.empty()) SendPoses(poses.ComposeShared(change.due));
      return;
  }
}

void Session::TellRegion(const PoseDelivery& delivery, const RegionMembers::Change& change) {
  const std::size_t count = change.left.size() + change.entered.size();
  if (count == 0) return;
  std::vector<protocol::Event> events;
  events.reserve(count);
  const auto add = [&](protocol::EventType type, std::span<const AvatarNumber> avatars) {
    for (const AvatarNumber avatar : avatars) {
      events.push_back({.type = type,
                        .avatar = avatar,
                        .tick = delivery.tick,
                        .time_s = host_.clock().TickTime(delivery.tick)});
    }
  };
  add(protocol::EventType::kLeft, change.left);
  add(protocol::EventType::kEntered, change.entered);
  const EventDelivery own{delivery.world, delivery.tick,
                          std::make_shared<const std::vector<protocol::Event>>(std::move(events))};
  std::uint64_t dropped = 0;
  ForEachEventFrame(
      own, [&](protocol::Events&& message) { dropped += SendNumbered(std::move(message)); });
  CountDropped(delivery.world, dropped);
}

void Session::SendPoses(const PoseDelivery& delivery) {
  const std::size_t dropped = connection_->SendPoses(delivery);
  if (dropped == 0) return;
  worlds_.at(delivery.world).dropped_batches += dropped;
  host_.metrics().batches_dropped.Add(dropped);
  host_.metrics().Reached(Limit::kObserverBacklog);
}

void Session::OnEvents(SharedEvents& events) {
  const EventDelivery& delivery = events.delivery();
  if (is_ended_ || !WantsEvents(delivery.world)) return;
  std::uint64_t dropped = 0;
  if ((features_ & protocol::kFeatureEventReplay) == 0) {
    bool is_full = false;
    for (const SharedFrame& frame : events.frames()) {
      is_full |= !connection_->SendEvents(frame);
    }
    if (is_full) dropped = delivery.events->size();
  } else {
    ForEachEventFrame(
        delivery, [&](protocol::Events&& message) { dropped += SendNumbered(std::move(message)); });
  }
  CountDropped(delivery.world, dropped);
}

std::uint64_t Session::SendNumbered(protocol::Events&& message) {
  const bool is_replayed = (features_ & protocol::kFeatureEventReplay) != 0;
  message.number = is_replayed ? ++events_number_ : 0;
  const SharedFrame frame = EncodeFrame(host_.encoder(), message);
  if (frame == nullptr) return 0;
  const bool was_sent = connection_ != nullptr && connection_->SendEvents(frame);
  // What a full connection did not take is lost: sent later it would be out of order.
  if (connection_ != nullptr && !was_sent) return message.events.size();
  if (!is_replayed) return 0;
  event_replay_.Keep({message.number, message.events.size(), was_sent, frame});
  const std::uint64_t forgotten = event_replay_.TakeForgotten();
  if (forgotten > 0) host_.metrics().Reached(Limit::kEventReplay);
  return forgotten;
}

void Session::CountDropped(WorldId world, std::uint64_t events) {
  if (events == 0) return;
  if (connection_ != nullptr) host_.metrics().Reached(Limit::kControlBuffer);
  // Forgotten ones may have been of another of its worlds; their sum is what counts.
  worlds_.at(world).dropped_events += events;
  host_.metrics().events_dropped.Add(events);
}

}  // namespace stridewire::server
