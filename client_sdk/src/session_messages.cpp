// Functions of a session that handle the messages of the server.

#include <algorithm>
#include <cmath>
#include <utility>

#include "session.h"

namespace stridewire::client {

namespace {

constexpr std::size_t kMaxRtts = 16;

stridewire_status ToStatus(protocol::StatusCode code) {
  return static_cast<stridewire_status>(code);
}

void CopyVector(const DVec3& v, double (&out)[3]) {
  out[0] = v.x;
  out[1] = v.y;
  out[2] = v.z;
}

stridewire_parameters ToParameters(std::span<const protocol::ParameterValue> parameters) {
  stridewire_parameters out{};
  for (const auto& [value, name] : parameters) {
    out.names[out.count] = name;
    out.values[out.count++] = value;
  }
  return out;
}

stridewire_event_type ToEventType(protocol::EventType type) {
  return static_cast<stridewire_event_type>(STRIDEWIRE_EVENT_ACCEPTED + static_cast<int>(type));
}
static_assert(STRIDEWIRE_EVENT_LEFT - STRIDEWIRE_EVENT_ACCEPTED ==
              static_cast<int>(protocol::EventType::kLeft));
static_assert(STRIDEWIRE_OUTCOME_REMOVED == static_cast<int>(protocol::RequestOutcome::kRemoved));

}  // namespace

void Session::Handle(const protocol::Welcome& message, double now_s) {
  if (state_ != State::kGreeting) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent a second Welcome", now_s);
  }
  if (message.resumed && resume_token_.empty()) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR,
                          "the server resumed a session that does not exist", now_s);
  }
  if (message.protocol != protocol::kProtocolVersion) {
    return CloseWithError(STRIDEWIRE_VERSION_MISMATCH, "the server uses another protocol version");
  }
  state_ = State::kReady;
  ready_s_ = now_s;
  ++connects_;
  limits_ = message.limits;
  tick_hz_ = message.tick_hz;
  resume_token_ = message.resume_token;
  encoder_ = protocol::Encoder(protocol::FrameLimits{
      .max_control_bytes =
          std::min<std::size_t>(limits_.max_control_bytes, protocol::kMaxControlBytes),
      .max_bulk_bytes = std::min<std::size_t>(limits_.max_bulk_bytes, protocol::kMaxBulkBytes)});

  stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_CONNECTED, 0, STRIDEWIRE_OK, AddressText());
  event.resumed = message.resumed ? 1 : 0;
  events_.Push(event);
  if (message.resumed) {
    ++resumes_;
    resend_from_ = unanswered_.empty() ? 0 : unanswered_.begin()->first;
    for (auto& [handle, world] : worlds_) world.view->Break();
  } else {
    if (had_session_) events_.Push(MakeEvent(STRIDEWIRE_EVENT_SESSION_LOST));
    RestoreSession();
  }
  had_session_ = true;
  SendPing(now_s);
}

void Session::RestoreSession() {
  next_seq_ = 1;
  resend_from_ = 0;
  last_events_number_ = 0;
  clock_.Reset();
  playout_.Reset();

  // An unanswered Observe is sent again under its command number, because its REPLY is still
  // pending.
  std::map<protocol::SubscriptionId, Command> unanswered_observes;
  for (auto& [seq, command] : std::exchange(unanswered_, {})) {
    const auto world = worlds_.find(command.world);
    const bool is_known = world != worlds_.end();
    if (is_known && std::holds_alternative<protocol::JoinWorld>(command.message)) continue;
    if (std::holds_alternative<protocol::LeaveWorld>(command.message) ||
        std::holds_alternative<protocol::StopObserving>(command.message)) {
      Answer(command, STRIDEWIRE_OK);  // In a new session there is nothing to leave or to stop.
      continue;
    }
    if (const auto* observe = std::get_if<protocol::Observe>(&command.message)) {
      if (observe->replace) {
        Answer(command, STRIDEWIRE_OK);  // The subscription is restored below.
        continue;
      }
      if (is_known && world->second.subscriptions.contains(observe->subscription)) {
        unanswered_observes.emplace(observe->subscription, std::move(command));
        continue;
      }
    }
    if (command.own) continue;  // The session's own commands are created again below.
    Answer(command, STRIDEWIRE_SESSION_LOST, "the session was lost before the server answered");
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
    ResetWorld(handle, world);

    std::deque<Command> first;
    for (auto& [id, subscription] : world.subscriptions) {
      if (subscription.unsent) continue;  // The subscription's Observe is still in `unsent`.
      subscription.unsent = true;
      if (const auto found = unanswered_observes.find(id); found != unanswered_observes.end()) {
        // The latest message is used, because the region may have moved.
        found->second.message = subscription.message;
        first.push_back(std::move(found->second));
      } else {
        first.push_back(Command{0, handle, true, 0, subscription.message});
      }
    }
    // Removes the spawns of an earlier lost session. They are created again below.
    std::erase_if(world.unsent, [](const Command& command) {
      return command.own && std::holds_alternative<protocol::Spawn>(command.message);
    });
    if (options_.respawn) {
      protocol::Spawn spawn;
      const std::size_t max_items =
          std::clamp<std::size_t>(limits_.max_items, 1, protocol::kMaxItems);
      for (const auto& [avatar, base] : world.spawned) {
        spawn.items.push_back({avatar, base});
        if (spawn.items.size() == max_items) {
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

void Session::ResetWorld(stridewire_world handle, World& world) {
  world.state = World::State::kWanted;
  world.server_id = 0;
  world.last_dropped_batches = 0;
  world.view->Clear();
  world.view->Break();
  world.replicas.reset();
  SetTerrainOf(handle, std::nullopt);
}

void Session::Handle(const protocol::WorldInfo& message, double now_s) {
  if (state_ != State::kReady) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent WorldInfo before Welcome",
                          now_s);
  }
  World* world = nullptr;
  if (message.seq != 0) {
    const auto command = unanswered_.find(message.seq);
    if (command == unanswered_.end()) return;
    if (!std::holds_alternative<protocol::JoinWorld>(command->second.message)) {
      return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR,
                            "the server sent WorldInfo for a command other than JoinWorld", now_s);
    }
    const auto joined = worlds_.find(command->second.world);
    if (joined == worlds_.end()) return;
    world = &joined->second;
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
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent a Reply before Welcome",
                          now_s);
  }
  const auto found = unanswered_.find(message.seq);
  // A second Reply may arrive after a resume. It is ignored.
  if (found == unanswered_.end()) return;
  const Command command = std::move(found->second);
  unanswered_.erase(found);
  answered_command_ = command.own ? 0 : command.id;
  // Replies may arrive in any order. The world is unknown if a later LeaveWorld was answered first.
  const auto entry = worlds_.find(command.world);
  World* world = entry == worlds_.end() ? nullptr : &entry->second;

  if (world != nullptr && std::holds_alternative<protocol::JoinWorld>(command.message)) {
    return OnJoinReply(*world, message, now_s);
  }
  stridewire_status status = ToStatus(message.code);
  const auto* spawn = std::get_if<protocol::Spawn>(&command.message);
  for (const protocol::ReplyItem& item : message.items) {
    const bool chosen = spawn != nullptr && item.index < spawn->items.size() &&
                        spawn->items[item.index].avatar == 0;
    if ((item.code == protocol::StatusCode::kOk && !chosen) || IsExpected(command, item)) continue;
    if (!options_.detailed_events && !command.own) continue;
    stridewire_event event =
        MakeEvent(STRIDEWIRE_EVENT_ITEM, command.world, ToStatus(item.code), item.text);
    event.command = command.id;
    event.item_index = item.index;
    event.avatar = item.avatar;
    event.request_id = item.request_id;
    events_.Push(event);
  }
  if (std::holds_alternative<protocol::StopObserving>(command.message)) {
    // The subscription has already ended, which is the requested state.
    if (status == STRIDEWIRE_NO_SUCH_SUBSCRIPTION) status = STRIDEWIRE_OK;
  } else if (world != nullptr && spawn != nullptr) {
    OnSpawnReply(*world, *spawn, message);
  } else if (const auto* remove = std::get_if<protocol::Remove>(&command.message);
             world != nullptr && remove != nullptr) {
    OnRemoveReply(*world, *remove, message);
  } else if (const auto* observe = std::get_if<protocol::Observe>(&command.message);
             world != nullptr && observe != nullptr) {
    OnObserveReply(*world, *observe, message);
  }
  // Failed items do not change the status of the reply. If it is OK, the client reports the status
  // of the first failed item instead.
  std::string text = message.text;
  for (const protocol::ReplyItem& item : message.items) {
    if (status != STRIDEWIRE_OK) break;
    if (item.code == protocol::StatusCode::kOk || IsExpected(command, item)) continue;
    status = ToStatus(item.code);
    text = "item " + std::to_string(item.index) + ": " + item.text;
  }
  Answer(command, status, text, message.accepted);
  if (std::holds_alternative<protocol::LeaveWorld>(command.message)) worlds_.erase(command.world);
}

// Returns true if a failed item is expected. An avatar that the session spawns again may still
// exist, because the world outlives the session.
bool Session::IsExpected(const Command& command, const protocol::ReplyItem& item) {
  return command.own && item.code == protocol::StatusCode::kAvatarExists;
}

void Session::OnJoinReply(World& world, const protocol::Reply& reply, double now_s) {
  stridewire_world handle = 0;
  for (const auto& [number, candidate] : worlds_) {
    if (&candidate == &world) handle = number;
  }
  const bool joined = reply.code == protocol::StatusCode::kOk;
  if (joined && world.server_id == 0) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR,
                          "the server sent no WorldInfo before its Reply", now_s);
  }
  const Command command{world.join_command, handle, world.join_answered, 0, {}};
  answered_command_ = command.own ? 0 : command.id;
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
    SetTerrainOf(handle, std::nullopt);
  }
}

void Session::SetTerrainOf(stridewire_world handle,
                           const std::optional<protocol::TerrainInfo>& terrain) {
  World& world = worlds_.at(handle);
  if (world.terrain == terrain) return;
  world.terrain = terrain;
  events_.Push(MakeEvent(STRIDEWIRE_EVENT_TERRAIN, handle));
}

void Session::Handle(const protocol::WorldTerrain& message, double now_s) {
  if (state_ != State::kReady) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent WorldTerrain before Welcome",
                          now_s);
  }
  stridewire_world handle = 0;
  if (FindByServerId(message.world, handle) != nullptr) SetTerrainOf(handle, message.terrain);
}

void Session::OnSpawnReply(World& world, const protocol::Spawn& spawn,
                           const protocol::Reply& reply) {
  if (reply.code != protocol::StatusCode::kOk) return;
  for (const protocol::ReplyItem& item : reply.items) {
    if (item.code != protocol::StatusCode::kOk || item.index >= spawn.items.size()) continue;
    const protocol::SpawnItem& placed = spawn.items[item.index];
    if (placed.teleport) {
      // The avatar may belong to another session.
      if (const auto ours = world.spawned.find(item.avatar); ours != world.spawned.end()) {
        ours->second = placed.start;
      }
      continue;
    }
    if (world.spawned.size() >= protocol::kMaxItems) break;
    world.spawned.try_emplace(item.avatar, placed.start);
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
  // Earlier poses belong to a subscription that has ended. The server cannot flag this gap, because
  // it sends the same batches to other clients.
  if (world.subscriptions.size() == 1) world.view->Break();
}

void Session::Handle(const protocol::PoseBatch& message, double now_s) {
  if (state_ != State::kReady) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent a PoseBatch before Welcome",
                          now_s);
  }
  stridewire_world handle = 0;
  World* world = FindByServerId(message.info.world, handle);
  if (world == nullptr || !world->view->has_info() || world->subscriptions.empty()) return;
  FollowPoses(message.info.server_time_s, now_s);
  const std::uint64_t every_n_ticks = EveryNTicks(*world, message.info.mode);
  if (Status status = world->view->Apply(message, every_n_ticks, counts_); !status) {
    LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, Describe(status.error()), now_s);
  }
}

void Session::Handle(const protocol::Movements& message, double now_s) {
  if (state_ != State::kReady) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent Movements before Welcome",
                          now_s);
  }
  stridewire_world handle = 0;
  World* world = FindByServerId(message.world, handle);
  if (world == nullptr || world->replicas == nullptr) return;
  const std::uint64_t every_n_ticks = EveryNTicks(*world, protocol::PoseMode::kMovement);
  // The server may delay movements of ticks that the client does not evaluate. The delay of the
  // network can therefore not be derived from them.
  if (message.tick % every_n_ticks == 0) FollowPoses(message.server_time_s, now_s);
  if (Status status = world->view->Apply(message, *world->replicas, every_n_ticks, counts_);
      !status) {
    LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, Describe(status.error()), now_s);
  }
}

void Session::FollowPoses(double server_time_s, double now_s) {
  clock_.AddSample(now_s, server_time_s);
  if (playout_.AddSample(now_s, server_time_s, PoseIntervalS()) && options_.render_delay_s < 0.0) {
    ++playout_jumps_;
    for (auto& [handle, world] : worlds_) {
      world.view->RenumberSegments();
      world.view->Break();
    }
  }
  const double late_s = clock_.last_lateness_s();
  jitter_s_ += (late_s - jitter_s_) / 64.0;
  if (late_s >= worst_jitter_s_ || now_s - worst_jitter_at_s_ > ClockMap::kWindowS) {
    worst_jitter_s_ = late_s;
    worst_jitter_at_s_ = now_s;
  }
}

void Session::Handle(const protocol::AvatarState& message, double now_s) {
  if (state_ != State::kReady) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent AvatarState before Welcome",
                          now_s);
  }
  if (inspections_.contains(message.nonce)) answered_command_ = message.nonce;
  EndInspection(message.nonce, ToStatus(message.code), message.text);
}

void Session::Handle(const protocol::LibraryPiece& message, double now_s) {
  if (state_ != State::kReady) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent LibraryPiece before Welcome",
                          now_s);
  }
  libraries_.OnPiece(message);
  Pump();
}

void Session::Handle(const protocol::Events& message, double now_s) {
  if (state_ != State::kReady) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent Events before Welcome",
                          now_s);
  }
  if (message.number != 0) {
    // After a resume, the server may send messages again. Those that have been received already are
    // ignored.
    if (message.number <= last_events_number_) return;
    last_events_number_ = message.number;
  }
  stridewire_world handle = 0;
  World* world = FindByServerId(message.world, handle);
  if (world == nullptr) return;
  for (const protocol::Event& e : message.events) {
    ++events_received_;
    FollowSpawned(*world, e);
    if (!options_.detailed_events) continue;
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
    const bool is_step = e.kind <= protocol::MovementKind::kStepRight;
    if (e.type == protocol::EventType::kFootStrike ||
        (e.type == protocol::EventType::kRejected && is_step)) {
      event.foot =
          e.foot == protocol::FootSide::kLeft ? STRIDEWIRE_FOOT_LEFT : STRIDEWIRE_FOOT_RIGHT;
    }
    CopyVector(e.position_m, event.position_m);
    CopyVector(e.base.position_m, event.base_position_m);
    event.base_heading_rad = e.base.heading_rad;
    event.missed_m = e.missed_m;
    event.missed_rad = e.missed_rad;
    event.nearest_length_m = e.nearest.length_m;
    event.nearest_side_m = e.nearest.side_m;
    event.nearest_height_m = e.nearest.height_m;
    event.nearest_turn_rad = e.nearest.turn_rad;
    event.nearest_heading_rad = e.nearest.heading_rad;
    event.speed_m_s = e.speed_m_s;
    event.outcome = static_cast<stridewire_outcome>(e.outcome);
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
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent Lagging before Welcome",
                          now_s);
  }
  stridewire_world handle = 0;
  World* world = FindByServerId(message.world, handle);
  if (world == nullptr) return;
  if (message.dropped_batches > world->last_dropped_batches) {
    dropped_batches_ += message.dropped_batches - world->last_dropped_batches;
  }
  world->last_dropped_batches = message.dropped_batches;
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
    return CloseWithError(status, message.text);
  }
  LoseConnection(status, message.text, now_s);
}

void Session::Handle(const protocol::Pong& message, double now_s) {
  if (state_ != State::kReady) {
    return LoseConnection(STRIDEWIRE_PROTOCOL_ERROR, "the server sent Pong before Welcome", now_s);
  }
  clock_.AddSample(now_s, message.server_time_s);
  const double rtt_s = std::max(0.0, now_s - message.time_s);
  if (rtts_s_.size() == kMaxRtts) rtts_s_.pop_front();
  rtts_s_.push_back(rtt_s);
  if (pending_pings_.erase(message.nonce) > 0) {
    stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_PONG);
    event.rtt_s = rtt_s;
    event.tick = message.tick;
    event.time_s = message.server_time_s;
    events_.Push(event);
  }
}

void Session::Handle(const protocol::Goodbye& message, double now_s) {
  const stridewire_status status = ToStatus(message.code);
  resume_token_.clear();  // The session has ended, so it cannot be resumed.
  const int hundred = static_cast<int>(status) / 100;
  if (hundred < 3 || status == STRIDEWIRE_REPLACED) return CloseWithError(status, message.text);
  LoseConnection(status, message.text, now_s);
}

}  // namespace stridewire::client
