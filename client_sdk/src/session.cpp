#include "session.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "stridewire/protocol/check.h"
#include "stridewire/protocol/decode.h"

namespace stridewire::client {

namespace {

constexpr std::size_t kMaxSubscriptions = 256;  // Of one world.
// Of an avatar whose poses are evaluated here: its part of the memory that all may have besides their histories.
constexpr std::size_t kReplicaBytes = std::size_t{16} << 10;
constexpr std::size_t kMaxAskedPings = 64;
constexpr std::size_t kMaxRtts = 16;

stridewire_status ToStatus(protocol::StatusCode code) {
  return static_cast<stridewire_status>(code);
}

stridewire_status ToStatus(ErrorCode code) {
  switch (code) {
    case ErrorCode::kOutOfRange: return STRIDEWIRE_OUT_OF_RANGE;
    case ErrorCode::kUnsupported: return STRIDEWIRE_UNSUPPORTED;
    default: return STRIDEWIRE_INVALID_ARGUMENT;
  }
}

/// As many bytes of `text` as fit, not ending inside a UTF-8 character, and a final 0.
void CopyText(std::string_view text, char* out, std::size_t out_bytes) {
  std::size_t length = std::min(text.size(), out_bytes - 1);
  if (length < text.size()) {
    while (length > 0 && (static_cast<unsigned char>(text[length]) & 0xC0) == 0x80) --length;
  }
  if (length > 0) std::memcpy(out, text.data(), length);  // No text may be no pointer, too.
  out[length] = '\0';
}

void CopyVector(const DVec3& v, double (&out)[3]) {
  out[0] = v.x;
  out[1] = v.y;
  out[2] = v.z;
}

stridewire_parameters ToParameters(const protocol::ParameterSet& set) {
  stridewire_parameters out{};
  out.count = set.count;
  for (std::size_t i = 0; i < set.count; ++i) {
    out.names[i] = set.names[i];
    out.values[i] = set.values[i];
  }
  return out;
}

stridewire_event_type ToEventType(protocol::EventType type) {
  return static_cast<stridewire_event_type>(STRIDEWIRE_EVENT_ACCEPTED + static_cast<int>(type));
}
static_assert(STRIDEWIRE_EVENT_LEFT - STRIDEWIRE_EVENT_ACCEPTED ==
              static_cast<int>(protocol::EventType::kLeft));

std::size_t TerrainBytes(const std::optional<protocol::TerrainInfo>& terrain) {
  if (!terrain) return 0;
  std::size_t bytes = terrain->boxes.size() * sizeof(protocol::TerrainBoxInfo);
  if (terrain->height_field) bytes += terrain->height_field->heights_m.size() * sizeof(float);
  return bytes;
}

}  // namespace

Session::Session(const SessionOptions& options)
    : options_(options),
      backoff_(options.seed),
      events_(options.max_events),
      libraries_(options.library_folder) {
  pose_budget_.limit_bytes = options.max_pose_bytes;
}

// ---- the caller's side

stridewire_status Session::Open(double now_s) {
  switch (state_) {
    case State::kIdle:
    case State::kClosing:
    case State::kClosed: break;
    default: return Refuse(STRIDEWIRE_ALREADY_CONNECTED, "the client is connected already");
  }
  ForgetEverything();
  backoff_.Reset();
  last_status_ = STRIDEWIRE_OK;
  last_text_.clear();
  state_ = State::kWaiting;
  next_attempt_s_ = now_s;
  return STRIDEWIRE_OK;
}

void Session::Close(double now_s) {
  if (state_ == State::kIdle || state_ == State::kClosing) return;
  const bool was_closed = state_ == State::kClosed;
  const bool say_goodbye = state_ == State::kReady;
  FailAll(STRIDEWIRE_CANCELLED, "the client was disconnected");
  auto output = std::move(output_);
  const std::uint64_t connection = connection_number_;
  ForgetEverything();
  state_ = State::kIdle;
  if (say_goodbye) {
    output_ = std::move(output);
    if (encoder_.Encode(protocol::Goodbye{}, output_)) {
      state_ = State::kClosing;
      connection_number_ = connection;
      deadline_s_ = now_s + kGoodbye_s;
    }
  }
  if (!was_closed) events_.Push(MakeEvent(STRIDEWIRE_EVENT_CLOSED));
}

stridewire_status Session::Refuse(stridewire_status status, std::string_view text) {
  last_status_ = status;
  last_text_ = text;
  return status;
}

bool Session::IsOpen() const {
  return state_ == State::kWaiting || state_ == State::kConnecting || state_ == State::kGreeting ||
         state_ == State::kReady;
}

template <typename Message>
stridewire_status Session::Enqueue(stridewire_world world, Message message, std::size_t bytes,
                                   std::uint64_t& command) {
  // The numbers come when it is sent; the rest is checked now, when the caller can still be told.
  message.seq = 1;
  if constexpr (requires { message.world; }) message.world = 1;
  if (Status status = protocol::Check(message); !status) {
    return Refuse(ToStatus(status.error().code), Describe(status.error()));
  }
  if (!IsOpen()) return Refuse(STRIDEWIRE_CLOSED, "the client is not connected");
  const auto found = worlds_.find(world);
  if (found == worlds_.end()) return Refuse(STRIDEWIRE_NO_SUCH_WORLD, "no world has this number");
  if (found->second.state == World::State::kRefused || found->second.state == World::State::kLeft) {
    return Refuse(STRIDEWIRE_NOT_JOINED, "the server refused this world, or it was left");
  }
  bytes += sizeof(Command);
  if (command_count_ >= options_.max_commands ||
      command_bytes_ + bytes > options_.max_command_bytes) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many commands are without an answer");
  }
  ++command_count_;
  command_bytes_ += bytes;
  command = next_command_++;
  found->second.unsent.push_back(Command{command, world, false, bytes, std::move(message)});
  return STRIDEWIRE_OK;
}

stridewire_status Session::JoinWorld(std::string_view name, protocol::Role role,
                                     stridewire_world& world, std::uint64_t& command) {
  if (Status status = protocol::Check(protocol::JoinWorld{1, std::string(name), role}); !status) {
    return Refuse(ToStatus(status.error().code), Describe(status.error()));
  }
  if (!IsOpen()) return Refuse(STRIDEWIRE_CLOSED, "the client is not connected");
  for (auto& [handle, other] : worlds_) {
    if (other.name == name && other.state != World::State::kRefused) {
      return Refuse(STRIDEWIRE_ALREADY_JOINED, "a world of this name is joined already");
    }
  }
  // A refused world makes room for trying again.
  std::erase_if(worlds_, [&](const auto& entry) {
    return entry.second.name == name && entry.second.state == World::State::kRefused;
  });
  if (worlds_.size() >= kMaxWorlds) {
    return Refuse(STRIDEWIRE_LIMIT_REACHED, "too many worlds are joined");
  }
  if (command_count_ >= options_.max_commands) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many commands are without an answer");
  }
  world = next_world_++;
  command = next_command_++;
  ++command_count_;
  World joined;
  joined.name = name;
  joined.role = role;
  joined.join_command = command;
  joined.view = std::make_unique<WorldView>(options_.pose_history, pose_budget_);
  worlds_.emplace(world, std::move(joined));
  Pump();
  return STRIDEWIRE_OK;
}

stridewire_status Session::LeaveWorld(stridewire_world world, std::uint64_t& command) {
  if (stridewire_status status = Enqueue(world, protocol::LeaveWorld{}, 0, command);
      status != STRIDEWIRE_OK) {
    return status;
  }
  World& left = worlds_.at(world);
  const bool never_sent = left.state == World::State::kWanted;
  left.state = World::State::kLeft;
  if (never_sent) {
    const Command leave = std::move(left.unsent.back());
    left.unsent.pop_back();
    FailUnsent(left, STRIDEWIRE_NOT_JOINED, "the world was left");
    if (!left.join_answered) {
      Answer(Command{left.join_command, world, false, 0, {}}, STRIDEWIRE_NOT_JOINED,
             "the world was left");
    }
    Answer(leave, STRIDEWIRE_OK);
    worlds_.erase(world);
  }
  Pump();
  return STRIDEWIRE_OK;
}

template <typename Message>
stridewire_status Session::SendCommand(stridewire_world world, Message message, std::size_t bytes,
                                       std::uint64_t& command) {
  const stridewire_status status = Enqueue(world, std::move(message), bytes, command);
  Pump();
  return status;
}

stridewire_status Session::Spawn(stridewire_world world, protocol::Spawn message,
                                 std::uint64_t& command) {
  const std::size_t bytes = message.items.size() * sizeof(protocol::SpawnItem);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::Remove(stridewire_world world, protocol::Remove message,
                                  std::uint64_t& command) {
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarNumber);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::Request(stridewire_world world, protocol::Request message,
                                   std::uint64_t& command) {
  const std::size_t bytes = message.items.size() * sizeof(protocol::RequestItem);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::Cancel(stridewire_world world, protocol::CancelQueue message,
                                  std::uint64_t& command) {
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarNumber);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::SetTerrain(stridewire_world world, protocol::SetTerrain message,
                                      std::uint64_t& command) {
  const std::size_t bytes = TerrainBytes(message.terrain);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::SetLayers(stridewire_world world, protocol::SetLayers message,
                                     std::uint64_t& command) {
  const std::size_t bytes =
      message.items.size() * (sizeof(protocol::LayerItem) + protocol::kMaxNameBytes);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::SetPlanting(stridewire_world world, protocol::SetPlanting message,
                                       std::uint64_t& command) {
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarNumber);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::Observe(stridewire_world world, protocol::Observe message,
                                   std::uint32_t& subscription, std::uint64_t& command) {
  if (const auto found = worlds_.find(world);
      found != worlds_.end() && found->second.subscriptions.size() >= kMaxSubscriptions) {
    return Refuse(STRIDEWIRE_LIMIT_REACHED, "too many subscriptions of one world");
  }
  message.subscription = next_subscription_;
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarNumber);
  if (stridewire_status status = Enqueue(world, message, bytes, command); status != STRIDEWIRE_OK) {
    return status;
  }
  subscription = next_subscription_++;
  World& w = worlds_.at(world);
  w.subscriptions.emplace(subscription, Subscription{std::move(message)});
  UpdateFilter(w);
  Pump();
  return STRIDEWIRE_OK;
}

stridewire_status Session::MoveRegion(std::uint32_t subscription, protocol::Region region,
                                      std::uint64_t& command) {
  for (auto& [handle, world] : worlds_) {
    const auto found = world.subscriptions.find(subscription);
    if (found == world.subscriptions.end() || !found->second.message.region) continue;
    protocol::Observe message = found->second.message;
    message.region = std::move(region);
    message.replace = true;
    if (stridewire_status status = Enqueue(handle, message, 0, command); status != STRIDEWIRE_OK) {
      return status;
    }
    found->second.message.region = std::move(message.region);
    Pump();
    return STRIDEWIRE_OK;
  }
  return Refuse(STRIDEWIRE_NO_SUCH_SUBSCRIPTION, "no region has this number");
}

stridewire_status Session::StopObserving(std::uint32_t subscription, std::uint64_t& command) {
  for (auto& [handle, world] : worlds_) {
    const auto found = world.subscriptions.find(subscription);
    if (found == world.subscriptions.end()) continue;
    if (stridewire_status status =
            Enqueue(handle, protocol::StopObserving{1, subscription}, 0, command);
        status != STRIDEWIRE_OK) {
      return status;
    }
    world.subscriptions.erase(found);
    if (world.subscriptions.empty()) world.view->ClearPoses();
    if (EveryNTicks(world, protocol::PoseMode::kMovement) == 0) world.evaluated.reset();
    UpdateFilter(world);
    Pump();
    return STRIDEWIRE_OK;
  }
  return Refuse(STRIDEWIRE_NO_SUCH_SUBSCRIPTION, "no subscription has this number");
}

stridewire_status Session::Ping(double now_s) {
  if (state_ != State::kReady) return Refuse(STRIDEWIRE_NOT_READY, "the client is not connected");
  if (asked_pings_.size() >= kMaxAskedPings) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many pings are without an answer");
  }
  SendPing(now_s);
  asked_pings_.insert(ping_nonce_);
  return STRIDEWIRE_OK;
}

const WorldView* Session::FindWorld(stridewire_world world) const {
  const auto found = worlds_.find(world);
  return found == worlds_.end() ? nullptr : found->second.view.get();
}

void Session::UpdateFilter(World& world) {
  std::set<protocol::AvatarNumber> wanted;
  for (const auto& [id, subscription] : world.subscriptions) {
    const auto& avatars = subscription.message.avatars;
    if (avatars.empty()) return world.view->SetFilter(std::nullopt);
    wanted.insert(avatars.begin(), avatars.end());
  }
  if (wanted.empty()) return world.view->SetFilter(std::nullopt);
  world.view->SetFilter(std::move(wanted));
}

std::uint64_t Session::EveryNTicks(const World& world, protocol::PoseMode mode) {
  const protocol::PoseDetail detail = protocol::DetailOf(mode);
  // What was asked for as quantised.
  if (protocol::IsCompact(mode)) mode = protocol::PoseMode::kQuantised;
  std::uint64_t every = 0;
  const auto add = [&](protocol::PoseDetail of, std::uint64_t n) {
    if (of == detail) every = every == 0 ? n : std::min(every, n);
  };
  for (const auto& [id, subscription] : world.subscriptions) {
    const protocol::Observe& asked = subscription.message;
    if (asked.mode != mode) continue;
    add(asked.detail, asked.every_n_ticks);
    if (!asked.region) continue;
    for (std::size_t i = 0; i < asked.region->ring_details.size(); ++i) {
      add(asked.region->ring_details[i], asked.region->rings[i].every_n_ticks);
    }
  }
  return every;
}

Session::World* Session::FindByServerId(protocol::WorldId id, stridewire_world& handle) {
  for (auto& [number, world] : worlds_) {
    if (world.server_id == id) {
      handle = number;
      return &world;
    }
  }
  return nullptr;
}

stridewire_statistics Session::Statistics() const {
  stridewire_statistics s{};
  s.bytes_received = bytes_received_;
  s.bytes_sent = bytes_sent_;
  s.batches_received = counts_.batches;
  s.poses_received = counts_.poses;
  s.poses_refused = counts_.refused;
  s.batches_missing = counts_.missing;
  s.dropped_batches = dropped_batches_;
  s.events_received = events_received_;
  s.events_dropped = events_.dropped();
  s.commands_sent = commands_sent_;
  s.commands_resent = commands_resent_;
  s.commands_waiting = command_count_;
  s.connects = connects_;
  s.resumes = resumes_;
  s.connect_failures = connect_failures_;
  s.buffered_bytes = pose_budget_.used_bytes + events_.size() * sizeof(stridewire_event) +
                     command_bytes_ + output_.capacity() +
                     (reader_ ? reader_->capacity_bytes() : 0);
  for (const auto& [handle, world] : worlds_) s.buffered_bytes += TerrainBytes(world.terrain);
  if (!rtts_s_.empty()) s.rtt_s = *std::ranges::min_element(rtts_s_);
  return s;
}

// ---- the network's side

bool Session::ConnectDue(double now_s) const {
  return state_ == State::kWaiting && now_s >= next_attempt_s_;
}

void Session::StartConnecting(double now_s) {
  state_ = State::kConnecting;
  deadline_s_ = now_s + options_.connect_timeout_s;
  ++connection_number_;
}

void Session::OnConnected(double now_s) {
  if (state_ != State::kConnecting) return;
  state_ = State::kGreeting;
  libraries_.OnConnectionLost();
  deadline_s_ = now_s + options_.connect_timeout_s;
  heard_s_ = now_s;
  reader_.emplace(protocol::Sender::kServer);
  encoder_ = protocol::Encoder();
  output_.clear();
  protocol::Hello hello;
  hello.client_name = options_.client_name;
  hello.auth_token = options_.auth_token;
  hello.features =
      protocol::kFeatureResume | protocol::kFeatureEventReplay | protocol::kFeatureQuantised |
      protocol::kFeatureTerrain | protocol::kFeatureFootprints | protocol::kFeatureWalks |
      protocol::kFeatureRegions | protocol::kFeatureTakeovers | protocol::kFeatureLayers |
      protocol::kFeatureRefusals | protocol::kFeaturePlanting | protocol::kFeatureMovementMode |
      protocol::kFeatureCompact | protocol::kFeatureDetail;
  hello.resume_token = resume_token_;
  hello.last_events_number = resume_token_.empty() ? 0 : last_events_number_;
  if (Status status = encoder_.Encode(hello, output_); !status) {
    CloseForGood(STRIDEWIRE_INVALID_ARGUMENT, Describe(status.error()));
  }
}

void Session::OnBytes(std::span<const std::byte> bytes, double now_s) {
  if (state_ != State::kGreeting && state_ != State::kReady) return;
  heard_s_ = now_s;
  bytes_received_ += bytes.size();
  const std::uint64_t connection = connection_number_;
  for (;;) {
    auto frame = reader_->Next(bytes);
    if (!frame) return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, Describe(frame.error()), now_s);
    if (!*frame) break;
    auto message = protocol::DecodeMessage(**frame);
    if (!message) return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, Describe(message.error()), now_s);
    std::visit([&](const auto& m) { Handle(m, now_s); }, *message);
    if (connection != connection_number_ ||
        (state_ != State::kGreeting && state_ != State::kReady)) {
      return;
    }
  }
  Pump();
}

void Session::OnLost(stridewire_status status, std::string_view text, double now_s) {
  if (state_ == State::kClosing) {
    state_ = State::kIdle;
    output_.clear();
  } else if (state_ == State::kConnecting || state_ == State::kGreeting ||
             state_ == State::kReady) {
    BreakOff(status, text, now_s);
  }
}

void Session::AdvanceTime(double now_s) {
  switch (state_) {
    case State::kConnecting:
      if (now_s >= deadline_s_) BreakOff(STRIDEWIRE_TIMEOUT, "connecting took too long", now_s);
      break;
    case State::kGreeting:
      if (now_s >= deadline_s_) {
        BreakOff(STRIDEWIRE_TIMEOUT, "the server did not answer the greeting in time", now_s);
      }
      break;
    case State::kReady:
      if (limits_.idle_timeout_s > 0.0 && now_s - heard_s_ > limits_.idle_timeout_s) {
        BreakOff(STRIDEWIRE_TIMEOUT, "nothing was heard from the server for too long", now_s);
      } else if (now_s >= next_ping_s_ && output_.size() < kMaxOutputBytes) {
        SendPing(now_s);
      }
      break;
    case State::kClosing:
      if (now_s >= deadline_s_) {
        state_ = State::kIdle;
        output_.clear();
      }
      break;
    default: break;
  }
}

bool Session::NeedsSocket() const {
  return state_ == State::kConnecting || state_ == State::kGreeting || state_ == State::kReady ||
         state_ == State::kClosing;
}

bool Session::TakeOutput(std::vector<std::byte>& bytes) {
  if (state_ == State::kReady) Pump();
  if (output_.empty()) return false;
  bytes.clear();
  std::swap(bytes, output_);
  bytes_sent_ += bytes.size();
  return true;
}

void Session::OnOutputWritten() {
  if (state_ == State::kClosing && output_.empty()) state_ = State::kIdle;
}

void Session::SendPing(double now_s) {
  // Encoding cannot fail: the nonce is any number and time is finite.
  (void)encoder_.Encode(protocol::Ping{++ping_nonce_, now_s}, output_);
  double interval_s = options_.ping_interval_s;
  if (limits_.idle_timeout_s > 0.0) interval_s = std::min(interval_s, limits_.idle_timeout_s / 3.0);
  next_ping_s_ = now_s + interval_s;
}

// ---- commands

bool Session::MaySend() const {
  const std::size_t memory =
      std::clamp<std::size_t>(limits_.reply_memory, 1, protocol::kReplyMemory);
  return output_.size() < kMaxOutputBytes && unanswered_.size() < memory;
}

void Session::Pump() {
  if (state_ != State::kReady) return;

  // First what the server may have heard already, in order.
  while (resend_from_ != 0 && output_.size() < kMaxOutputBytes) {
    const auto next = unanswered_.lower_bound(resend_from_);
    if (next == unanswered_.end()) {
      resend_from_ = 0;
      break;
    }
    resend_from_ = next->first + 1;
    const Status status =
        std::visit([&](const auto& message) { return encoder_.Encode(message, output_); },
                   next->second.message);
    if (status) {
      ++commands_resent_;
    } else {
      // It could be encoded before; a server that has lowered its limits since gets a gap and says so.
      last_text_ = Describe(status.error());
    }
  }
  if (resend_from_ != 0) return;

  for (auto& [handle, world] : worlds_) {
    if (world.state == World::State::kWanted && MaySend()) {
      world.state = World::State::kJoining;
      Send(Command{world.join_command, handle, world.join_answered, 0,
                   protocol::JoinWorld{0, world.name, world.role}});
    }
    while (world.server_id != 0 && !world.unsent.empty() && MaySend()) {
      const Readiness readiness = PrepareMovements(world, world.unsent.front());
      if (readiness == Readiness::kWaits) break;
      if (readiness == Readiness::kRefused) {
        world.unsent.pop_front();
        continue;
      }
      Command command = std::move(world.unsent.front());
      world.unsent.pop_front();
      Send(std::move(command));
    }
  }
  AskForLibraries();
}

Session::Readiness Session::PrepareMovements(World& world, const Command& command) {
  const auto* observe = std::get_if<protocol::Observe>(&command.message);
  if (observe == nullptr || observe->mode != protocol::PoseMode::kMovement ||
      !world.subscriptions.contains(observe->subscription) || !Understands(command.message)) {
    return Readiness::kReady;
  }
  auto library = libraries_.Want(world.view->library_hash());
  if (!library) {
    world.subscriptions.erase(observe->subscription);
    UpdateFilter(world);
    const ErrorCode code = library.error().code;
    Answer(command,
           code == ErrorCode::kUnsupported       ? STRIDEWIRE_UNSUPPORTED
           : code == ErrorCode::kVersionMismatch ? STRIDEWIRE_VERSION_MISMATCH
                                                 : STRIDEWIRE_MALFORMED,
           library.error().text);
    return Readiness::kRefused;
  }
  if (*library == nullptr) return Readiness::kWaits;
  if (world.evaluated == nullptr) {
    world.evaluated = std::make_unique<MovementView>(*library, 1.0 / tick_hz_,
                                                     options_.max_pose_bytes / kReplicaBytes);
  }
  return Readiness::kReady;
}

void Session::AskForLibraries() {
  if (state_ != State::kReady || (features_ & protocol::kFeatureMovementMode) == 0) return;
  const auto may_ask = [&](const std::string& hash) {
    return std::ranges::any_of(worlds_, [&](const auto& item) {
      const World& world = item.second;
      return world.server_id != 0 && world.view->library_hash() == hash;
    });
  };
  if (const auto question = libraries_.TakeQuestion(may_ask)) {
    const Status status = encoder_.Encode(*question, output_);
    if (!status) last_text_ = Describe(status.error());
  }
}

void Session::OnLibraryTask(const std::string& hash,
                            Expected<std::shared_ptr<const MotionLibrary>> result) {
  libraries_.OnTask(hash, std::move(result));
  Pump();
}

bool Session::Understands(const CommandMessage& message) const {
  if (std::holds_alternative<protocol::SetTerrain>(message)) {
    return (features_ & protocol::kFeatureTerrain) != 0;
  }
  if (std::holds_alternative<protocol::SetLayers>(message)) {
    return (features_ & protocol::kFeatureLayers) != 0;
  }
  if (std::holds_alternative<protocol::SetPlanting>(message)) {
    return (features_ & protocol::kFeaturePlanting) != 0;
  }
  if (const auto* observe = std::get_if<protocol::Observe>(&message)) {
    if (observe->region && (features_ & protocol::kFeatureRegions) == 0) return false;
    constexpr std::uint64_t kDetail = protocol::kFeatureDetail | protocol::kFeatureCompact;
    const bool has_details = observe->detail != protocol::PoseDetail::kAll ||
                             (observe->region && !observe->region->ring_details.empty());
    if (has_details && (features_ & kDetail) != kDetail) return false;
    return observe->mode != protocol::PoseMode::kMovement ||
           (features_ & protocol::kFeatureMovementMode) != 0;
  }
  const auto* request = std::get_if<protocol::Request>(&message);
  if (request == nullptr) return true;
  const bool knows_footprints = (features_ & protocol::kFeatureFootprints) != 0;
  const bool knows_walks = (features_ & protocol::kFeatureWalks) != 0;
  const bool knows_takeovers = (features_ & protocol::kFeatureTakeovers) != 0;
  const bool knows_refusals = (features_ & protocol::kFeatureRefusals) != 0;
  return std::ranges::none_of(request->items, [&](const protocol::RequestItem& item) {
    if (item.takeover != protocol::Takeover::kNone && !knows_takeovers) return true;
    if (std::holds_alternative<protocol::WalkMovement>(item.movement)) return !knows_walks;
    const auto* step = std::get_if<protocol::StepMovement>(&item.movement);
    if (step == nullptr) return false;
    return (step->at.has_value() && !knows_footprints) || (step->must_be_met && !knows_refusals);
  });
}

void Session::Send(Command command) {
  if (!Understands(command.message)) {
    if (const auto* observe = std::get_if<protocol::Observe>(&command.message)) {
      World& refused = worlds_.at(command.world);
      refused.subscriptions.erase(observe->subscription);
      UpdateFilter(refused);
    }
    Answer(command, STRIDEWIRE_UNSUPPORTED, "this server does not know of it");
    return;
  }
  const World& world = worlds_.at(command.world);
  const Status status = std::visit(
      [&](auto& message) {
        message.seq = next_seq_;
        if constexpr (requires { message.world; }) message.world = world.server_id;
        return encoder_.Encode(message, output_);
      },
      command.message);
  if (!status) {
    // Larger than this server takes: its number was not used.
    Answer(command, STRIDEWIRE_LIMIT_REACHED, Describe(status.error()));
    return;
  }
  ++commands_sent_;
  if (const auto* observe = std::get_if<protocol::Observe>(&command.message)) {
    World& w = worlds_.at(command.world);
    if (const auto found = w.subscriptions.find(observe->subscription);
        found != w.subscriptions.end()) {
      found->second.unsent = false;
    }
  }
  unanswered_.emplace(next_seq_++, std::move(command));
}

void Session::Answer(const Command& command, stridewire_status status, std::string_view text,
                     std::uint32_t accepted) {
  if (command.own) {
    if (status == STRIDEWIRE_OK) return;
    events_.Push(MakeEvent(STRIDEWIRE_EVENT_NOTICE, command.world, status, text));
    return;
  }
  --command_count_;
  command_bytes_ -= command.bytes;
  stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_REPLY, command.world, status, text);
  event.command = command.id;
  event.accepted = accepted;
  events_.Push(event);
}

void Session::FailUnsent(World& world, stridewire_status status, std::string_view text) {
  for (const Command& command : std::exchange(world.unsent, {})) Answer(command, status, text);
}

void Session::FailAll(stridewire_status status, std::string_view text) {
  for (const auto& [seq, command] : std::exchange(unanswered_, {})) {
    if (std::holds_alternative<protocol::JoinWorld>(command.message)) continue;  // Below.
    Answer(command, status, text);
  }
  for (auto& [handle, world] : worlds_) {
    if (!world.join_answered) {
      world.join_answered = true;
      Answer(Command{world.join_command, handle, false, 0, {}}, status, text);
    }
    FailUnsent(world, status, text);
  }
}

// ---- messages

template <typename Message>
void Session::Handle(const Message&, double now_s) {
  BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "the server sent a client's message", now_s);
}

void Session::Handle(const protocol::Welcome& message, double now_s) {
  if (state_ != State::kGreeting) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "a second welcome", now_s);
  }
  if (message.resumed && resume_token_.empty()) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "the server resumed a session that was none", now_s);
  }
  if (message.protocol < protocol::kProtocolMin || message.protocol > protocol::kProtocolMax) {
    return CloseForGood(STRIDEWIRE_VERSION_MISMATCH, "the server speaks another version");
  }
  state_ = State::kReady;
  ready_s_ = now_s;
  ++connects_;
  features_ = message.features;
  limits_ = message.limits;
  tick_hz_ = message.tick_hz;
  resume_token_ = message.resume_token;
  encoder_ = protocol::Encoder(protocol::FrameLimits{
      .max_control_bytes =
          std::min<std::size_t>(limits_.max_control_bytes, protocol::kMaxControlBytes),
      .max_bulk_bytes = std::min<std::size_t>(limits_.max_bulk_bytes, protocol::kMaxBulkBytes)});

  stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_CONNECTED);
  event.resumed = message.resumed ? 1 : 0;
  events_.Push(event);
  if (message.resumed) {
    ++resumes_;
    resend_from_ = unanswered_.empty() ? 0 : unanswered_.begin()->first;
    for (auto& [handle, world] : worlds_) world.view->Break();
  } else {
    if (had_session_) events_.Push(MakeEvent(STRIDEWIRE_EVENT_SESSION_LOST));
    StartAnew();
  }
  had_session_ = true;
  SendPing(now_s);
}

void Session::StartAnew() {
  next_seq_ = 1;
  resend_from_ = 0;
  last_events_number_ = 0;
  clock_.Reset();

  // Observe keeps the number its caller waits for.
  std::map<protocol::SubscriptionId, Command> observing;
  for (auto& [seq, command] : std::exchange(unanswered_, {})) {
    if (std::holds_alternative<protocol::JoinWorld>(command.message)) continue;
    if (std::holds_alternative<protocol::LeaveWorld>(command.message) ||
        std::holds_alternative<protocol::StopObserving>(command.message)) {
      Answer(command, STRIDEWIRE_OK);  // Nothing of the session is left to leave or stop.
      continue;
    }
    if (const auto* observe = std::get_if<protocol::Observe>(&command.message)) {
      if (observe->replace) {
        Answer(command, STRIDEWIRE_OK);  // What is observed anew is there already.
        continue;
      }
      if (worlds_.at(command.world).subscriptions.contains(observe->subscription)) {
        observing.emplace(observe->subscription, std::move(command));
        continue;
      }
    }
    if (command.own) continue;  // It is given anew below.
    Answer(command, STRIDEWIRE_SESSION_LOST, "the session was lost before the answer came");
  }

  for (auto it = worlds_.begin(); it != worlds_.end();) {
    const stridewire_world handle = it->first;
    World& world = it->second;
    if (world.state == World::State::kLeft) {
      for (const Command& command : std::exchange(world.unsent, {})) {
        const bool leave = std::holds_alternative<protocol::LeaveWorld>(command.message);
        Answer(command, leave ? STRIDEWIRE_OK : STRIDEWIRE_SESSION_LOST);
      }
      if (!world.join_answered) {
        Answer(Command{world.join_command, handle, false, 0, {}}, STRIDEWIRE_SESSION_LOST);
      }
      it = worlds_.erase(it);
      continue;
    }
    ++it;
    if (world.state == World::State::kRefused) continue;
    world.state = World::State::kWanted;
    world.server_id = 0;
    world.told_dropped_batches = 0;
    world.view->Clear();
    world.view->Break();
    world.evaluated.reset();
    TakeTerrain(handle, std::nullopt);

    std::deque<Command> first;
    for (auto& [id, subscription] : world.subscriptions) {
      if (subscription.unsent) continue;  // Still waiting in its place.
      subscription.unsent = true;
      if (const auto found = observing.find(id); found != observing.end()) {
        found->second.message = subscription.message;  // A region may have moved since.
        first.push_back(std::move(found->second));
      } else {
        first.push_back(Command{0, handle, true, 0, subscription.message});
      }
    }
    // An own command that was still unsent when the session was lost again is among those anew.
    std::erase_if(world.unsent, [](const Command& command) {
      return command.own && std::holds_alternative<protocol::Spawn>(command.message);
    });
    if (options_.respawn) {
      protocol::Spawn spawn;
      const std::size_t most = std::clamp<std::size_t>(limits_.max_items, 1, protocol::kMaxItems);
      for (const auto& [avatar, base] : world.spawned) {
        spawn.items.push_back({avatar, base});
        if (spawn.items.size() == most) {
          first.push_back(Command{0, handle, true, 0, std::exchange(spawn, {})});
        }
      }
      if (!spawn.items.empty()) first.push_back(Command{0, handle, true, 0, std::move(spawn)});
    } else {
      world.spawned.clear();
    }
    world.unsent.insert(world.unsent.begin(), std::make_move_iterator(first.begin()),
                        std::make_move_iterator(first.end()));
  }
}

void Session::Handle(const protocol::WorldInfo& message, double now_s) {
  if (state_ != State::kReady) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "a world before the welcome", now_s);
  }
  World* world = nullptr;
  if (message.seq != 0) {
    const auto command = unanswered_.find(message.seq);
    if (command == unanswered_.end()) return;
    if (!std::holds_alternative<protocol::JoinWorld>(command->second.message)) {
      return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "a world in answer to another command", now_s);
    }
    world = &worlds_.at(command->second.world);
  } else {
    for (auto& [handle, candidate] : worlds_) {
      if (candidate.name == message.name && candidate.state != World::State::kRefused) {
        world = &candidate;
      }
    }
    if (world == nullptr) return;
  }
  world->server_id = message.world;
  world->view->SetInfo(message);
}

void Session::Handle(const protocol::Reply& message, double now_s) {
  if (state_ != State::kReady) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "an answer before the welcome", now_s);
  }
  const auto found = unanswered_.find(message.seq);
  if (found == unanswered_.end()) return;  // Answered twice, before and after a resume.
  const Command command = std::move(found->second);
  unanswered_.erase(found);
  World& world = worlds_.at(command.world);

  if (std::holds_alternative<protocol::JoinWorld>(command.message)) {
    return OnJoinReply(world, message, now_s);
  }
  stridewire_status status = ToStatus(message.code);
  const auto* spawn = std::get_if<protocol::Spawn>(&command.message);
  for (const protocol::ReplyItem& item : message.items) {
    const bool chosen = spawn != nullptr && item.index < spawn->items.size() &&
                        spawn->items[item.index].avatar == 0;
    // What we spawn anew may still be there: the server lost the session, not the world.
    const bool still_there = command.own && item.code == protocol::StatusCode::kAvatarExists;
    if ((item.code == protocol::StatusCode::kOk && !chosen) || still_there) continue;
    stridewire_event event =
        MakeEvent(STRIDEWIRE_EVENT_ITEM, command.world, ToStatus(item.code), item.text);
    event.command = command.id;
    event.item_index = item.index;
    event.avatar = item.avatar;
    event.request_id = item.request_id;
    events_.Push(event);
  }
  if (spawn != nullptr) {
    OnSpawnReply(world, *spawn, message);
  } else if (const auto* remove = std::get_if<protocol::Remove>(&command.message)) {
    OnRemoveReply(world, *remove, message);
  } else if (const auto* observe = std::get_if<protocol::Observe>(&command.message)) {
    OnObserveReply(world, *observe, message);
  } else if (std::holds_alternative<protocol::StopObserving>(command.message)) {
    // Not observing is what was wanted.
    if (status == STRIDEWIRE_NO_SUCH_SUBSCRIPTION) status = STRIDEWIRE_OK;
  }
  Answer(command, status, message.text, message.accepted);
  if (std::holds_alternative<protocol::LeaveWorld>(command.message)) worlds_.erase(command.world);
}

void Session::OnJoinReply(World& world, const protocol::Reply& reply, double now_s) {
  stridewire_world handle = 0;
  for (const auto& [number, candidate] : worlds_) {
    if (&candidate == &world) handle = number;
  }
  const bool joined = reply.code == protocol::StatusCode::kOk;
  if (joined && world.server_id == 0) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "a world was joined and not described", now_s);
  }
  const Command command{world.join_command, handle, world.join_answered, 0, {}};
  world.join_answered = true;
  if (joined) {
    if (world.state == World::State::kJoining) world.state = World::State::kJoined;
    events_.Push(MakeEvent(STRIDEWIRE_EVENT_WORLD_JOINED, handle));
    Answer(command, STRIDEWIRE_OK, reply.text, reply.accepted);
  } else {
    world.state = World::State::kRefused;
    world.server_id = 0;
    Answer(command, ToStatus(reply.code), reply.text);
    FailUnsent(world, STRIDEWIRE_NOT_JOINED, reply.text);
    world.subscriptions.clear();
    world.view->Clear();
    TakeTerrain(handle, std::nullopt);
  }
}

void Session::TakeTerrain(stridewire_world handle,
                          const std::optional<protocol::TerrainInfo>& terrain) {
  World& world = worlds_.at(handle);
  if (world.terrain == terrain) return;
  world.terrain = terrain;
  events_.Push(MakeEvent(STRIDEWIRE_EVENT_TERRAIN, handle));
}

void Session::Handle(const protocol::WorldTerrain& message, double now_s) {
  if (state_ != State::kReady) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "a ground before the welcome", now_s);
  }
  stridewire_world handle = 0;
  if (FindByServerId(message.world, handle) != nullptr) TakeTerrain(handle, message.terrain);
}

void Session::OnSpawnReply(World& world, const protocol::Spawn& spawn,
                           const protocol::Reply& reply) {
  if (reply.code != protocol::StatusCode::kOk) return;
  for (const protocol::ReplyItem& item : reply.items) {
    if (item.code != protocol::StatusCode::kOk || item.index >= spawn.items.size()) continue;
    if (world.spawned.size() >= protocol::kMaxItems) break;
    world.spawned.try_emplace(item.avatar, spawn.items[item.index].start);
  }
}

void Session::OnRemoveReply(World& world, const protocol::Remove& remove,
                            const protocol::Reply& reply) {
  if (reply.code != protocol::StatusCode::kOk) return;
  std::set<std::uint32_t> refused;
  for (const protocol::ReplyItem& item : reply.items) refused.insert(item.index);
  for (std::uint32_t i = 0; i < remove.avatars.size(); ++i) {
    if (refused.contains(i)) continue;
    world.spawned.erase(remove.avatars[i]);
    world.view->Remove(remove.avatars[i]);
  }
}

void Session::OnObserveReply(World& world, const protocol::Observe& observe,
                             const protocol::Reply& reply) {
  if (observe.replace) return;
  if (reply.code != protocol::StatusCode::kOk) {
    world.subscriptions.erase(observe.subscription);
    UpdateFilter(world);
    return;
  }
  // Poses that came before, if any, belong to a subscription that has ended; the server cannot tell
  // it in a batch that others get too.
  if (world.subscriptions.size() == 1) world.view->Break();
}

void Session::Handle(const protocol::PoseBatch& message, double now_s) {
  if (state_ != State::kReady) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "poses before the welcome", now_s);
  }
  stridewire_world handle = 0;
  World* world = FindByServerId(message.info.world, handle);
  if (world == nullptr || !world->view->has_info() || world->subscriptions.empty()) return;
  clock_.AddSample(now_s, message.info.server_time_s);
  const std::uint64_t every_n_ticks = EveryNTicks(*world, message.info.mode);
  if (Status status = world->view->Take(message, every_n_ticks, counts_); !status) {
    BreakOff(STRIDEWIRE_PROTOCOL_ERROR, Describe(status.error()), now_s);
  }
}

void Session::Handle(const protocol::Movements& message, double now_s) {
  if (state_ != State::kReady) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "movements before the welcome", now_s);
  }
  stridewire_world handle = 0;
  World* world = FindByServerId(message.world, handle);
  if (world == nullptr || world->evaluated == nullptr) return;
  clock_.AddSample(now_s, message.server_time_s);
  const std::uint64_t every_n_ticks = EveryNTicks(*world, protocol::PoseMode::kMovement);
  if (Status status = world->view->Take(message, *world->evaluated, every_n_ticks, counts_);
      !status) {
    BreakOff(STRIDEWIRE_PROTOCOL_ERROR, Describe(status.error()), now_s);
  }
}

void Session::Handle(const protocol::LibraryPiece& message, double now_s) {
  if (state_ != State::kReady) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "a library before the welcome", now_s);
  }
  libraries_.OnPiece(message);
  Pump();
}

void Session::Handle(const protocol::Events& message, double now_s) {
  if (state_ != State::kReady) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "events before the welcome", now_s);
  }
  if (message.number != 0) {
    if (message.number <= last_events_number_) return;  // Sent again, and heard before.
    last_events_number_ = message.number;
  }
  stridewire_world handle = 0;
  World* world = FindByServerId(message.world, handle);
  if (world == nullptr) return;
  for (const protocol::Event& e : message.events) {
    ++events_received_;
    FollowSpawned(*world, e);
    stridewire_event event = MakeEvent(ToEventType(e.type), handle, ToStatus(e.code), e.reason);
    event.avatar = e.avatar;
    event.request_id = e.request_id;
    event.tick = e.tick;
    event.time_s = e.time_s;
    event.kind = static_cast<stridewire_movement_kind>(e.kind);
    event.group = e.group;
    event.requested = ToParameters(e.requested);
    event.applied = ToParameters(e.applied);
    event.extrapolated = e.extrapolated ? 1 : 0;
    event.clamped = e.clamped ? 1 : 0;
    event.cut_short = e.cut_short ? 1 : 0;
    if (e.type == protocol::EventType::kFootStrike) {
      event.foot =
          e.foot == protocol::FootSide::kLeft ? STRIDEWIRE_FOOT_LEFT : STRIDEWIRE_FOOT_RIGHT;
    }
    CopyVector(e.position_m, event.position_m);
    CopyVector(e.base.position_m, event.base_position_m);
    event.base_heading_rad = e.base.heading_rad;
    events_.Push(event);
  }
}

void Session::FollowSpawned(World& world, const protocol::Event& event) {
  switch (event.type) {
    case protocol::EventType::kSpawned:
    case protocol::EventType::kFinished:
    case protocol::EventType::kIdle:
      if (const auto ours = world.spawned.find(event.avatar); ours != world.spawned.end()) {
        ours->second = event.base;
      }
      break;
    case protocol::EventType::kRemoved:
      world.spawned.erase(event.avatar);
      world.view->Remove(event.avatar);
      break;
    case protocol::EventType::kLeft: world.view->Leave(event.avatar, event.tick); break;
    default: break;
  }
}

void Session::Handle(const protocol::Lagging& message, double now_s) {
  if (state_ != State::kReady) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "a report before the welcome", now_s);
  }
  stridewire_world handle = 0;
  World* world = FindByServerId(message.world, handle);
  if (world == nullptr) return;
  if (message.dropped_batches > world->told_dropped_batches) {
    dropped_batches_ += message.dropped_batches - world->told_dropped_batches;
  }
  world->told_dropped_batches = message.dropped_batches;
  stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_LAGGING, handle);
  event.dropped_batches = message.dropped_batches;
  event.dropped_events = message.dropped_events;
  events_.Push(event);
}

void Session::Handle(const protocol::ErrorNotice& message, double now_s) {
  const stridewire_status status = ToStatus(message.code);
  if (!message.fatal) {
    stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_NOTICE, 0, status, message.text);
    if (const auto command = unanswered_.find(message.seq); command != unanswered_.end()) {
      event.command = command->second.id;
      event.world = command->second.world;
    }
    events_.Push(event);
    return;
  }
  const int hundred = static_cast<int>(status) / 100;
  if (hundred == 1 || hundred == 2 || status == STRIDEWIRE_REPLACED) {
    return CloseForGood(status, message.text);
  }
  BreakOff(status, message.text, now_s);
}

void Session::Handle(const protocol::Pong& message, double now_s) {
  if (state_ != State::kReady) {
    return BreakOff(STRIDEWIRE_PROTOCOL_ERROR, "a pong before the welcome", now_s);
  }
  clock_.AddSample(now_s, message.server_time_s);
  const double rtt_s = std::max(0.0, now_s - message.time_s);
  if (rtts_s_.size() == kMaxRtts) rtts_s_.pop_front();
  rtts_s_.push_back(rtt_s);
  if (asked_pings_.erase(message.nonce) > 0) {
    stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_PONG);
    event.rtt_s = rtt_s;
    event.tick = message.tick;
    event.time_s = message.server_time_s;
    events_.Push(event);
  }
}

void Session::Handle(const protocol::Goodbye& message, double now_s) {
  const stridewire_status status = ToStatus(message.code);
  resume_token_.clear();  // The session has ended.
  const int hundred = static_cast<int>(status) / 100;
  if (hundred < 3 || status == STRIDEWIRE_REPLACED) return CloseForGood(status, message.text);
  BreakOff(status, message.text, now_s);
}

// ---- ends

void Session::BreakOff(stridewire_status status, std::string_view text, double now_s) {
  last_status_ = status;
  last_text_ = text.empty() ? stridewire_status_text(status) : text;
  const bool was_ready = state_ == State::kReady;
  if (was_ready && now_s - ready_s_ >= kStable_s) backoff_.Reset();
  if (!was_ready) ++connect_failures_;
  state_ = State::kWaiting;
  next_attempt_s_ = now_s + backoff_.Next();
  output_.clear();
  asked_pings_.clear();
  events_.Push(
      MakeEvent(was_ready ? STRIDEWIRE_EVENT_CONNECTION_LOST : STRIDEWIRE_EVENT_CONNECT_FAILED, 0,
                status, last_text_));
}

void Session::CloseForGood(stridewire_status status, std::string_view text) {
  last_status_ = status;
  last_text_ = text.empty() ? stridewire_status_text(status) : text;
  if (state_ != State::kReady) ++connect_failures_;
  state_ = State::kClosed;
  FailAll(status, last_text_);
  ForgetEverything();
  events_.Push(MakeEvent(STRIDEWIRE_EVENT_CLOSED, 0, status, last_text_));
}

void Session::ForgetEverything() {
  ++connection_number_;  // Whatever socket there is, it is no longer ours.
  unanswered_.clear();
  worlds_.clear();
  command_count_ = 0;
  command_bytes_ = 0;
  had_session_ = false;
  resume_token_.clear();
  next_seq_ = 1;
  resend_from_ = 0;
  last_events_number_ = 0;
  clock_.Reset();
  rtts_s_.clear();
  asked_pings_.clear();
  output_.clear();
}

stridewire_event Session::MakeEvent(stridewire_event_type type, stridewire_world world,
                                    stridewire_status status, std::string_view text) const {
  stridewire_event event{};
  event.type = type;
  event.world = world;
  event.status = status;
  event.group = -1;
  CopyText(text, event.text, sizeof event.text);
  return event;
}

}  // namespace stridewire::client
