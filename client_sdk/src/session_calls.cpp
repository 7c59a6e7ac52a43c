// Functions of a session that the application calls. They check arguments and create commands.

#include <algorithm>
#include <utility>

#include "session.h"
#include "stridewire/protocol/check.h"

namespace stridewire::client {

namespace {

constexpr std::size_t kMaxSubscriptions = 256;  // Per world.
constexpr std::size_t kMaxPendingPings = 64;

stridewire_status ToStatus(ErrorCode code) {
  switch (code) {
    case ErrorCode::kOutOfRange: return STRIDEWIRE_OUT_OF_RANGE;
    case ErrorCode::kUnsupported: return STRIDEWIRE_UNSUPPORTED;
    default: return STRIDEWIRE_INVALID_ARGUMENT;
  }
}

std::size_t TerrainBytes(const std::optional<protocol::TerrainInfo>& terrain) {
  if (!terrain) return 0;
  std::size_t bytes = terrain->boxes.size() * sizeof(protocol::TerrainBoxInfo);
  if (terrain->height_field) bytes += terrain->height_field->heights_m.size() * sizeof(float);
  return bytes;
}

}  // namespace

stridewire_status Session::Open(double now_s) {
  switch (state_) {
    case State::kIdle:
    case State::kClosing:
    case State::kClosed: break;
    default: return Refuse(STRIDEWIRE_ALREADY_CONNECTED, "the client is already connected");
  }
  Reset();
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
  const bool sends_goodbye = state_ == State::kReady;
  FailAll(STRIDEWIRE_CANCELLED, "the client was disconnected");
  auto output = std::move(output_);
  const std::uint64_t connection = connection_number_;
  Reset();
  state_ = State::kIdle;
  if (sends_goodbye) {
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
  // Seq and world are set when the command is sent. All other fields are checked now, so that the
  // call can report errors.
  message.seq = 1;
  if constexpr (requires { message.world; }) message.world = 1;
  if (Status status = protocol::Check(message); !status) {
    return Refuse(ToStatus(status.error().code), Describe(status.error()));
  }
  if (!IsOpen()) return Refuse(STRIDEWIRE_CLOSED, "the client is not connected");
  const auto found = worlds_.find(world);
  if (found == worlds_.end()) return Refuse(STRIDEWIRE_NO_SUCH_WORLD, "no world has this number");
  if (found->second.state == World::State::kRefused || found->second.state == World::State::kLeft) {
    return Refuse(STRIDEWIRE_NOT_JOINED, "the world is not joined");
  }
  bytes += sizeof(Command);
  if (command_count_ >= options_.max_commands ||
      command_bytes_ + bytes > options_.max_command_bytes) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many commands are unanswered");
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
      return Refuse(STRIDEWIRE_ALREADY_JOINED, "a world of this name is already joined");
    }
  }
  // A world that the server refused can be joined again.
  std::erase_if(worlds_, [&](const auto& entry) {
    return entry.second.name == name && entry.second.state == World::State::kRefused;
  });
  if (worlds_.size() >= kMaxWorlds) {
    return Refuse(STRIDEWIRE_LIMIT_REACHED, "too many worlds are joined");
  }
  if (command_count_ >= options_.max_commands) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many commands are unanswered");
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
    FailUnsent(left, STRIDEWIRE_NOT_JOINED, "the client left the world");
    if (!left.join_answered) {
      Answer(Command{left.join_command, world, false, 0, {}}, STRIDEWIRE_NOT_JOINED,
             "the client left the world");
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
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarId);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::Request(stridewire_world world, protocol::Request message,
                                   std::uint64_t& command) {
  const std::size_t bytes = message.items.size() * sizeof(protocol::RequestItem);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::Cancel(stridewire_world world, protocol::CancelQueue message,
                                  std::uint64_t& command) {
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarId);
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
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarId);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status Session::Observe(stridewire_world world, protocol::Observe message,
                                   std::uint32_t& subscription, std::uint64_t& command) {
  if (const auto found = worlds_.find(world);
      found != worlds_.end() && found->second.subscriptions.size() >= kMaxSubscriptions) {
    return Refuse(STRIDEWIRE_LIMIT_REACHED, "too many subscriptions of one world");
  }
  message.subscription = next_subscription_;
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarId);
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
  return Refuse(STRIDEWIRE_NO_SUCH_SUBSCRIPTION, "no region has this subscription number");
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
    if (EveryNTicks(world, protocol::PoseMode::kMovement) == 0) world.replicas.reset();
    UpdateFilter(world);
    Pump();
    return STRIDEWIRE_OK;
  }
  return Refuse(STRIDEWIRE_NO_SUCH_SUBSCRIPTION, "no subscription has this number");
}

stridewire_status Session::Ping(double now_s) {
  if (state_ != State::kReady) return Refuse(STRIDEWIRE_NOT_READY, "the client is not connected");
  if (pending_pings_.size() >= kMaxPendingPings) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many pings are unanswered");
  }
  SendPing(now_s);
  pending_pings_.insert(ping_nonce_);
  return STRIDEWIRE_OK;
}

const WorldView* Session::FindWorld(stridewire_world world) const {
  const auto found = worlds_.find(world);
  return found == worlds_.end() ? nullptr : found->second.view.get();
}

void Session::UpdateFilter(World& world) {
  std::set<protocol::AvatarId> wanted;
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
  // Compact poses belong to subscriptions of kQuantised.
  if (protocol::IsCompact(mode)) mode = protocol::PoseMode::kQuantised;
  std::uint64_t every = 0;
  const auto add = [&](protocol::PoseDetail of, std::uint64_t n) {
    if (of == detail) every = every == 0 ? n : std::min(every, n);
  };
  for (const auto& [id, subscription] : world.subscriptions) {
    const protocol::Observe& observe = subscription.message;
    if (observe.mode != mode) continue;
    add(observe.detail, observe.every_n_ticks);
    if (!observe.region) continue;
    for (std::size_t i = 0; i < observe.region->ring_details.size(); ++i) {
      add(observe.region->ring_details[i], observe.region->rings[i].every_n_ticks);
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

}  // namespace stridewire::client
