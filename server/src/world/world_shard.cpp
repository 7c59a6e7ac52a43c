#include "world/world_shard.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/check.h"
#include "runtime/avatar/movement_record.h"
#include "world/convert.h"
#include "world/inspect.h"

namespace stridewire::server {

using protocol::EventType;
using protocol::PoseMode;
using protocol::ReplyItem;
using protocol::StatusCode;

namespace {

bool IsSpawnable(const protocol::Placement& start) {
  return std::abs(start.position_m.x) <= kMaxSpawnM && std::abs(start.position_m.y) <= kMaxSpawnM &&
         std::abs(start.position_m.z) <= kMaxSpawnM &&
         std::abs(start.heading_rad) <= kMaxSpawnHeadingRad;
}

// Maximum number of dropped requests that are reported per tick. One command can drop millions of
// requests, and their events would take gigabytes.
constexpr std::size_t kMaxDroppedPerTick = 16384;

ReplyItem NoSuchAvatar(std::uint32_t index, AvatarId avatar, protocol::RequestId request = 0) {
  return {index, avatar, request, StatusCode::kNoSuchAvatar, "no avatar has this id"};
}

}  // namespace

WorldShard::WorldShard(WorldShardDef def)
    : world_(std::move(def.world)),
      shard_(def.shard),
      max_queue_(def.max_queue),
      max_bulk_bytes_(def.max_bulk_bytes),
      clock_(def.clock),
      budget_(def.budget),
      metrics_(def.metrics),
      cache_(def.scratch != nullptr ? std::move(def.scratch)
                                    : std::make_shared<PoseScratch>(world_->library),
             world_->quantizations == nullptr ? nullptr : &world_->quantizations->codecs),
      terrain_(world_->terrain.Get()),
      interest_(def.shard_count) {
  STRIDEWIRE_CHECK(shard_ >= 0 && shard_ < def.shard_count && max_queue_ >= 1);
}

WorldShard::~WorldShard() { budget_.Release(*world_, static_cast<std::int64_t>(avatars_.size())); }

protocol::Event& WorldShard::AddEvent(EventType type, AvatarId avatar, std::uint64_t tick) {
  protocol::Event& event = events_.emplace_back();
  event.type = type;
  event.avatar = avatar;
  event.tick = tick;
  event.time_s = clock_.TickTime(tick);
  return event;
}

void WorldShard::ReportDropped(AvatarId id, AvatarSimulation& avatar, std::uint64_t tick) {
  const std::vector<DroppedRequest> dropped = avatar.TakeDropped();
  if (dropped.empty() || !interest_.events()) return;
  for (const DroppedRequest& request : dropped) dropped_.push_back({id, request});
  ReportDropped(tick);
}

void WorldShard::ReportDropped(std::uint64_t tick) {
  if (!interest_.events()) dropped_.clear();
  for (; !dropped_.empty() && dropped_events_left_ > 0; --dropped_events_left_) {
    const auto& [avatar, request] = dropped_.front();
    protocol::Event& event = AddEvent(EventType::kRejected, avatar, tick);
    event.request_id = request.id;
    event.code = StatusCode::kDropped;
    event.reason = DropReason(request.outcome);
    event.outcome = static_cast<protocol::RequestOutcome>(request.outcome);
    dropped_.pop_front();
  }
}

CommandResult WorldShard::Execute(const WorldCommand& command, std::uint64_t tick) {
  CommandResult result;
  result.session = command.session;
  result.seq = command.seq;
  std::visit(
      [&]<typename T>(const T& part) {
        if constexpr (std::is_same_v<T, SpawnPart>) {
          Spawn(command, part, tick, result);
        } else if constexpr (std::is_same_v<T, RequestPart>) {
          Request(part, tick, result);
        } else if constexpr (std::is_same_v<T, RemovePart>) {
          Remove(part, tick, result);
        } else if constexpr (std::is_same_v<T, CancelPart>) {
          Cancel(part, tick, result);
        } else if constexpr (std::is_same_v<T, LayerPart>) {
          SetLayers(part, result);
        } else if constexpr (std::is_same_v<T, PlantingPart>) {
          SetPlanting(part, result);
        } else if constexpr (std::is_same_v<T, TerrainPart>) {
          STRIDEWIRE_CHECK(next_terrains_.empty() || next_terrains_.back().tick <= part.tick);
          next_terrains_.push_back(part);
        } else {
          Release(command.session, tick);
        }
      },
      command.part);
  return result;
}

void WorldShard::Spawn(const WorldCommand& command, const SpawnPart& part, std::uint64_t tick,
                       CommandResult& result) {
  AvatarOptions options = world_->avatar_options;
  options.terrain = terrain();
  for (const SpawnPart::Item& item : part.items) {
    const AvatarId id = item.spawn.avatar;
    ReplyItem reply{.index = item.index, .avatar = id};
    const auto existing = avatars_.find(id);
    if (!IsSpawnable(item.spawn.start)) {
      reply.code = StatusCode::kOutOfRange;
      reply.text = "start: expected a position within 100 km and a heading within 10000 rad";
    } else if (item.spawn.teleport && existing == avatars_.end()) {
      reply = NoSuchAvatar(item.index, id);
    } else if (!item.spawn.teleport && existing != avatars_.end()) {
      reply.code = StatusCode::kAvatarExists;
      reply.text = "an avatar with this id already exists";
    }
    if (reply.code != StatusCode::kOk) {
      if (!item.spawn.teleport) budget_.Release(*world_);
      result.items.push_back(std::move(reply));
      continue;
    }
    const BaseFrame start = FromWire(item.spawn.start);
    if (item.spawn.teleport) {
      Entry& entry = existing->second;
      entry.avatar.Teleport(start);
      entry.placed_tick = tick;
      ReportDropped(id, entry.avatar, tick);
      ++result.accepted;
      result.items.push_back(std::move(reply));
      continue;
    }
    options.seed = id;
    avatars_.emplace(id, Entry{.avatar = AvatarSimulation(world_->library, start, options),
                               .owner = command.session,
                               .placed_tick = tick});
    is_order_valid_ = false;
    if (interest_.events()) {
      AddEvent(EventType::kSpawned, id, tick).base = item.spawn.start;
    }
    ++result.accepted;
    result.items.push_back(std::move(reply));
  }
}

void WorldShard::Request(const RequestPart& part, std::uint64_t tick, CommandResult& result) {
  std::uint64_t delayed = 0;
  auto it = avatars_.end();
  for (const RequestPart::Item& item : part.items) {
    const protocol::RequestItem& asked = item.request;
    // The items of a large command are usually sorted by avatar id, so the next avatar is tried
    // before a search.
    if (it != avatars_.end() && it->first != asked.avatar) ++it;
    if (it == avatars_.end() || it->first != asked.avatar) it = avatars_.find(asked.avatar);
    if (it == avatars_.end()) {
      result.items.push_back(NoSuchAvatar(item.index, asked.avatar, asked.request_id));
      continue;
    }
    AvatarSimulation& avatar = it->second.avatar;
    const std::uint32_t delay_ticks = StartTickOf(asked.avatar, part.over_ticks);
    delayed += delay_ticks > 0;
    ReplyItem refused{.index = item.index, .avatar = asked.avatar, .request_id = asked.request_id};
    if (asked.interrupt == protocol::Interrupt::kNone && avatar.queue_size() >= max_queue_) {
      metrics_.Reached(Limit::kQueue);
      refused.code = StatusCode::kQueueFull;
      refused.text = "the avatar's queue is full";
    } else if (const Status status = avatar.Enqueue(FromWire(asked), delay_ticks * clock_.tick_s());
               !status) {
      refused.code = ToStatusCode(status.error().code);
      refused.text = status.error().text;
    }
    if (refused.code != StatusCode::kOk) {
      result.items.push_back(std::move(refused));
      continue;
    }
    ++result.accepted;
    ReportDropped(asked.avatar, avatar, tick);
    if (interest_.events()) {
      protocol::Event& accepted = AddEvent(EventType::kAccepted, asked.avatar, tick);
      accepted.request_id = asked.request_id;
      const auto* walk = std::get_if<protocol::WalkMovement>(&asked.movement);
      if (walk != nullptr && walk->speed_m_s) {
        accepted.speed_m_s = world_->walk_speeds.Nearest(*walk->speed_m_s);
        accepted.clamped = world_->walk_speeds.IsOutside(*walk->speed_m_s);
      }
    }
  }
  metrics_.requests_accepted.Add(result.accepted);
  metrics_.requests_rejected.Add(part.items.size() - result.accepted);
  if (delayed > 0) metrics_.Reached(Limit::kStartsPerTick, delayed);
}

void WorldShard::Remove(const RemovePart& part, std::uint64_t tick, CommandResult& result) {
  for (const AvatarRef& ref : part.avatars) {
    const auto it = avatars_.find(ref.avatar);
    if (it == avatars_.end()) {
      result.items.push_back(NoSuchAvatar(ref.index, ref.avatar));
      continue;
    }
    it->second.avatar.DropAll(RequestOutcome::kRemoved);
    ReportDropped(ref.avatar, it->second.avatar, tick);
    avatars_.erase(it);
    is_order_valid_ = false;
    ++result.accepted;
    RecordRemoval(ref.avatar);
    if (interest_.events()) AddEvent(EventType::kRemoved, ref.avatar, tick);
  }
  budget_.Release(*world_, result.accepted);
}

void WorldShard::Cancel(const CancelPart& part, std::uint64_t tick, CommandResult& result) {
  for (const AvatarRef& ref : part.avatars) {
    const auto it = avatars_.find(ref.avatar);
    if (it == avatars_.end()) {
      result.items.push_back(NoSuchAvatar(ref.index, ref.avatar));
      continue;
    }
    it->second.avatar.CancelQueue();
    ReportDropped(ref.avatar, it->second.avatar, tick);
    ++result.accepted;
  }
}

void WorldShard::SetLayers(const LayerPart& part, CommandResult& result) {
  for (const LayerPart::Item& item : part.items) {
    const protocol::LayerItem& asked = item.layer;
    const auto it = avatars_.find(asked.avatar);
    if (it == avatars_.end()) {
      result.items.push_back(NoSuchAvatar(item.index, asked.avatar));
      continue;
    }
    const Status status =
        it->second.avatar.SetLayer({.layer = world_->library->FindLayer(asked.layer),
                                    .enabled = asked.enabled,
                                    .weight = asked.weight,
                                    .blend_s = asked.blend_s,
                                    .speed = asked.speed});
    if (status) {
      ++result.accepted;
      continue;
    }
    const ErrorCode code = status.error().code;
    result.items.push_back({.index = item.index,
                            .avatar = asked.avatar,
                            .code = code == ErrorCode::kNotFound        ? StatusCode::kNoMovement
                                    : code == ErrorCode::kLimitExceeded ? StatusCode::kLimitReached
                                                                        : StatusCode::kOutOfRange,
                            .text = status.error().text});
  }
  metrics_.requests_accepted.Add(result.accepted);
  metrics_.requests_rejected.Add(part.items.size() - result.accepted);
}

void WorldShard::SetPlanting(const PlantingPart& part, CommandResult& result) {
  for (const AvatarRef& ref : part.avatars) {
    const auto it = avatars_.find(ref.avatar);
    if (it == avatars_.end()) {
      result.items.push_back(NoSuchAvatar(ref.index, ref.avatar));
    } else if (const Status status = it->second.avatar.SetFootPlanting(part.enabled); !status) {
      result.items.push_back({.index = ref.index,
                              .avatar = ref.avatar,
                              .code = ToStatusCode(status.error().code),
                              .text = status.error().text});
    } else {
      ++result.accepted;
    }
  }
  metrics_.requests_accepted.Add(result.accepted);
  metrics_.requests_rejected.Add(part.avatars.size() - result.accepted);
}

void WorldShard::Release(SessionId session, std::uint64_t tick) {
  if (world_->persistent) return;
  for (auto& [id, entry] : avatars_) {
    if (entry.owner != session) continue;
    entry.avatar.DropAll(RequestOutcome::kRemoved);
    ReportDropped(id, entry.avatar, tick);
  }
  const std::size_t removed = std::erase_if(avatars_, [&](const auto& item) {
    if (item.second.owner != session) return false;
    RecordRemoval(item.first);
    if (interest_.events()) AddEvent(EventType::kRemoved, item.first, tick);
    return true;
  });
  is_order_valid_ = false;
  budget_.Release(*world_, static_cast<std::int64_t>(removed));
}

void WorldShard::ApplyTerrain(std::uint64_t tick) {
  while (!next_terrains_.empty() && next_terrains_.front().tick <= tick) {
    terrain_ = std::move(next_terrains_.front().terrain);
    next_terrains_.pop_front();
    for (auto& [id, entry] : avatars_) entry.avatar.SetTerrain(terrain());
  }
}

void WorldShard::Advance(std::uint64_t tick, int steps) {
  STRIDEWIRE_CHECK(steps >= 1 && tick >= tick_);
  tick_ = tick;
  dropped_events_left_ = kMaxDroppedPerTick;
  ReportDropped(tick);
  steps_left_ = static_cast<std::uint16_t>(steps);
  // Steps of missed ticks use the terrain that was valid at their ticks.
  while (steps > 1 && !next_terrains_.empty() && next_terrains_.front().tick <= tick) {
    const std::uint64_t first = tick - static_cast<std::uint64_t>(steps) + 1;
    const std::uint64_t change = next_terrains_.front().tick;
    if (change <= first) {
      ApplyTerrain(first);
      continue;
    }
    AdvanceAvatars(change - 1, static_cast<int>(change - first));
    steps = static_cast<int>(tick - change) + 1;
  }
  ApplyTerrain(tick);
  AdvanceAvatars(tick, steps);
  STRIDEWIRE_CHECK(steps_left_ == 0);
}

std::span<const WorldShard::OrderedAvatar> WorldShard::OrderedAvatars() {
  if (!is_order_valid_) {
    ordered_.clear();
    advancing_.clear();
    std::vector<AvatarId> ids;
    ids.reserve(avatars_.size());
    for (auto& [id, entry] : avatars_) {
      ordered_.push_back({id, &entry});
      advancing_.push_back(&entry.avatar);
      ids.push_back(id);
    }
    ids_ = std::make_shared<const std::vector<AvatarId>>(std::move(ids));
    all_rows_.resize(avatars_.size());
    std::iota(all_rows_.begin(), all_rows_.end(), 0u);
    is_order_valid_ = true;
    are_selected_rows_valid_ = false;
  }
  STRIDEWIRE_CHECK(ordered_.size() == avatars_.size());
  return ordered_;
}

void WorldShard::AdvanceAvatars(std::uint64_t tick, int steps) {
  const double step_s = clock_.tick_s();
  const std::span<const OrderedAvatar> ordered = OrderedAvatars();
  for (int step = 1; step <= steps; ++step) {
    AvatarSimulation::AdvanceStates(advancing_, step_s, cache_.plan_scratch(), &eventful_);
    ++step_;
    --steps_left_;
    if (interest_.movements()) RecordMovements();
    const std::uint64_t step_tick = tick - static_cast<std::uint64_t>(steps - step);
    if (!interest_.events()) continue;
    for (const std::uint32_t row : eventful_) {
      const auto& [id, entry] = ordered[row];
      for (const AvatarEvent& happened : entry->avatar.events()) {
        protocol::Event& event = events_.emplace_back(ToWire(happened, *world_->library));
        event.avatar = id;
        event.tick = step_tick;
        event.time_s = clock_.TickTime(step_tick) - (entry->avatar.time_s() - happened.time_s);
      }
    }
  }
}

void WorldShard::SetInterest(const Interest& interest) {
  interest_.Set(interest);
  are_selected_rows_valid_ = false;
  cache_.SetModes(interest_.CompactModes(), interest_.CommonInterval());
  for (std::size_t mode = 0; mode < kSentModes.size(); ++mode) {
    // If a session selects avatars that do not exist, it needs one delivery without poses to
    // recognize this.
    last_had_poses_[mode] = interest_.IsObserved(kSentModes[mode]) &&
                            (last_had_poses_[mode] || interest.poses[mode].interval.subset > 0);
  }
}

std::shared_ptr<const std::vector<protocol::Event>> WorldShard::TakeEvents() {
  if (events_.empty()) return nullptr;
  auto events = std::make_shared<const std::vector<protocol::Event>>(std::exchange(events_, {}));
  events_.reserve(events->size());  // The next tick probably has as many events.
  return events;
}

void WorldShard::RecordRemoval(AvatarId avatar) {
  if (interest_.movements()) removed_.push_back(avatar);
}

protocol::Movements WorldShard::EmptyMovements() const {
  return {.world = world_->id,
          .shard = static_cast<std::uint16_t>(shard_),
          .more_steps = steps_left_,
          .step = step_,
          .tick = tick_,
          .server_time_s = clock_.TickTime(tick_)};
}

// Returns true if the message contains kMaxItems avatars, or if one more record of the maximum size
// could exceed the frame limit.
bool WorldShard::IsFull(const protocol::Movements& message) const {
  constexpr std::size_t kOverheadBytes = 256;
  constexpr std::size_t kAvatarBytes = 9;  // Size of an avatar's id, flags and end.
  return message.avatars.size() == protocol::kMaxItems ||
         message.records.size() + (message.avatars.size() + 1) * kAvatarBytes + kOverheadBytes +
                 MaxRecordBytes(*world_->library) >
             max_bulk_bytes_;
}

// Records the movements that started in the last step.
void WorldShard::RecordMovements() {
  const std::span<const OrderedAvatar> ordered = OrderedAvatars();
  if (ordered.empty() && removed_.empty() && !last_step_had_avatars_) return;
  last_step_had_avatars_ = !ordered.empty();
  const std::size_t first = movements_.size();
  movements_.push_back(EmptyMovements());
  const auto add = [&](AvatarId id, std::uint8_t flags) {
    protocol::Movements& message = movements_.back();
    message.avatars.push_back(id);
    message.flags.push_back(flags);
    message.ends.push_back(static_cast<std::uint32_t>(message.records.size()));
    if (IsFull(message)) movements_.push_back(EmptyMovements());
  };
  for (const AvatarId id : removed_) add(id, protocol::kMovementGone);
  removed_.clear();
  for (const std::uint32_t row : eventful_) {
    const auto& [id, entry] = ordered[row];
    if (!AppendChange(entry->avatar, movements_.back().records)) continue;
    const bool is_new = entry->placed_tick == tick_ && entry->avatar.change().needs_state;
    add(id, is_new ? protocol::kPoseDiscontinuity : 0);
  }
  const std::size_t parts = movements_.size() - first;
  // There are too many parts only if the frame limit is far below the default. Clients then detect
  // a missing step and discard the avatars of this shard.
  if (parts > protocol::kMaxBatchParts) {
    metrics_.pose_errors.Add(ordered.size());
    movements_.resize(first);
    return;
  }
  for (std::size_t part = 0; part < parts; ++part) {
    movements_[first + part].part = static_cast<std::uint16_t>(part);
    movements_[first + part].parts = static_cast<std::uint16_t>(parts);
  }
}

bool WorldShard::TakeMovements(std::uint64_t tick, MovementDelivery& delivery) {
  if (movements_.empty()) return false;
  for (const protocol::Movements& message : movements_) {
    metrics_.movements_encoded.Add(message.avatars.size());
  }
  delivery = {.world = world_->id,
              .from_shard = shard_,
              .tick = tick,
              .steps = std::make_shared<const std::vector<protocol::Movements>>(
                  std::exchange(movements_, {})),
              .avatars = nullptr,
              .grid = nullptr};
  if (interest_.movement_regions()) {
    delivery.grid = GridAt(tick);
    delivery.avatars = ids_;
  }
  return true;
}

StatesResult WorldShard::States(const StatesRequest& request, protocol::Encoder& encoder) const {
  StatesResult result{.world = world_->id,
                      .from_shard = shard_,
                      .session = request.session,
                      .nonce = request.nonce};
  protocol::Movements message = EmptyMovements();
  message.states = true;
  const auto add = [&](AvatarId id, const Entry& entry) {
    if (message.records.size() > request.enough_bytes || IsFull(message)) {
      result.next = id;
      return;
    }
    // If an avatar is new, the movements of this tick also contain its state, which is the same.
    AppendState(entry.avatar, message.records);
    message.avatars.push_back(id);
    message.flags.push_back(0);
    message.ends.push_back(static_cast<std::uint32_t>(message.records.size()));
  };
  if (request.avatars == nullptr) {
    for (auto it = avatars_.lower_bound(request.first); it != avatars_.end() && result.next == 0;
         ++it) {
      add(it->first, it->second);
    }
  } else {
    const std::vector<AvatarId>& ids = *request.avatars;
    for (auto id = std::ranges::lower_bound(ids, request.first);
         id != ids.end() && result.next == 0; ++id) {
      if (const auto it = avatars_.find(*id); it != avatars_.end()) add(*id, it->second);
    }
  }
  if (message.avatars.empty()) return result;
  auto frame = std::make_shared<std::vector<std::byte>>();
  const Status status = encoder.Encode(message, *frame);
  STRIDEWIRE_CHECK(status.has_value());
  result.frame = std::move(frame);
  return result;
}

protocol::AvatarState WorldShard::Inspect(AvatarId avatar, std::uint64_t tick,
                                          std::size_t max_site_bytes) const {
  protocol::AvatarState state;
  const auto it = avatars_.find(avatar);
  if (it == avatars_.end()) {
    state.code = StatusCode::kNoSuchAvatar;
    state.text = "no avatar has this id";
  } else {
    const Entry& entry = it->second;
    state = server::Inspect(entry.avatar, max_site_bytes);
    if (state.movement) {
      state.movement->started_s += clock_.TickTime(tick) - entry.avatar.time_s();
    }
    for (protocol::RequestItem& item : state.queue) item.avatar = avatar;
  }
  state.world = world_->id;
  state.avatar = avatar;
  state.tick = tick;
  state.server_time_s = clock_.TickTime(tick);
  return state;
}

}  // namespace stridewire::server
