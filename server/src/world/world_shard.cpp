#include "world/world_shard.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stridewire/base/check.h"
#include "world/convert.h"
#include "world/inspect.h"

namespace stridewire::server {

using protocol::EventType;
using protocol::PoseMode;
using protocol::ReplyItem;
using protocol::StatusCode;

namespace {

std::size_t ModeIndex(PoseMode mode) { return mode == PoseMode::kFull ? 0 : 1; }

bool IsSpawnable(const protocol::Placement& start) {
  return std::abs(start.position_m.x) <= kMaxSpawnM && std::abs(start.position_m.y) <= kMaxSpawnM &&
         std::abs(start.position_m.z) <= kMaxSpawnM &&
         std::abs(start.heading_rad) <= kMaxSpawnHeadingRad;
}

ReplyItem NoSuchAvatar(std::uint32_t index, AvatarNumber avatar, protocol::RequestId request = 0) {
  return {index, avatar, request, StatusCode::kNoSuchAvatar, "no avatar of that number"};
}

}  // namespace

WorldShard::WorldShard(std::shared_ptr<World> world, int shard, int shard_count, int max_queue,
                       const TickClock& clock, AvatarBudget& budget, ThreadMetrics& metrics)
    : world_(std::move(world)),
      shard_(shard),
      max_queue_(max_queue),
      clock_(clock),
      budget_(budget),
      metrics_(metrics),
      interests_(static_cast<std::size_t>(shard_count)),
      ground_(world_->ground.Get()) {}

WorldShard::~WorldShard() { budget_.Release(*world_, static_cast<std::int64_t>(avatars_.size())); }

protocol::Event& WorldShard::AddEvent(EventType type, AvatarNumber avatar, std::uint64_t tick) {
  protocol::Event& event = events_.emplace_back();
  event.type = type;
  event.avatar = avatar;
  event.tick = tick;
  event.time_s = clock_.TickTime(tick);
  return event;
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
          Cancel(part, result);
        } else if constexpr (std::is_same_v<T, LayerPart>) {
          SetLayers(part, result);
        } else if constexpr (std::is_same_v<T, PlantingPart>) {
          SetPlanting(part, result);
        } else if constexpr (std::is_same_v<T, GroundPart>) {
          grounds_.push_back(part);
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
    const AvatarNumber number = item.spawn.avatar;
    ReplyItem reply{.index = item.index, .avatar = number};
    if (!IsSpawnable(item.spawn.start)) {
      reply.code = StatusCode::kOutOfRange;
      reply.text = "a position lies beyond 100 km or a heading beyond 10000 rad";
    } else if (avatars_.contains(number)) {
      reply.code = StatusCode::kAvatarExists;
      reply.text = "an avatar of that number lives already";
    }
    if (reply.code != StatusCode::kOk) {
      budget_.Release(*world_);
      result.items.push_back(std::move(reply));
      continue;
    }
    const BaseFrame start = FromWire(item.spawn.start);
    avatars_.emplace(number, Entry{.avatar = Avatar(world_->library, start, options),
                                   .owner = command.session,
                                   .spawn_tick = tick});
    is_order_known_ = false;
    if (events_wanted_) {
      AddEvent(EventType::kSpawned, number, tick).base = item.spawn.start;
    }
    ++result.accepted;
    result.items.push_back(std::move(reply));
  }
}

void WorldShard::Request(const RequestPart& part, std::uint64_t tick, CommandResult& result) {
  std::uint64_t held = 0;
  for (const RequestPart::Item& item : part.items) {
    const protocol::RequestItem& asked = item.request;
    const auto it = avatars_.find(asked.avatar);
    if (it == avatars_.end()) {
      result.items.push_back(NoSuchAvatar(item.index, asked.avatar, asked.request_id));
      continue;
    }
    Avatar& avatar = it->second.avatar;
    const std::uint32_t hold_ticks = StartTickOf(asked.avatar, part.over_ticks);
    held += hold_ticks > 0;
    ReplyItem refused{.index = item.index, .avatar = asked.avatar, .request_id = asked.request_id};
    if (asked.takeover == protocol::Takeover::kNone && avatar.queue_size() >= max_queue_) {
      metrics_.Reached(Limit::kQueue);
      refused.code = StatusCode::kQueueFull;
      refused.text = "the avatar's queue is full";
    } else if (const Status status = avatar.Enqueue(FromWire(asked), hold_ticks * clock_.tick_s());
               !status) {
      refused.code = ToStatusCode(status.error().code);
      refused.text = status.error().text;
    }
    if (refused.code != StatusCode::kOk) {
      result.items.push_back(std::move(refused));
      continue;
    }
    ++result.accepted;
    if (events_wanted_) {
      AddEvent(EventType::kAccepted, asked.avatar, tick).request_id = asked.request_id;
    }
  }
  metrics_.requests_accepted.Add(result.accepted);
  metrics_.requests_rejected.Add(part.items.size() - result.accepted);
  if (held > 0) metrics_.Reached(Limit::kStartsPerTick, held);
}

void WorldShard::Remove(const RemovePart& part, std::uint64_t tick, CommandResult& result) {
  for (const AvatarRef& ref : part.avatars) {
    if (avatars_.erase(ref.avatar) == 0) {
      result.items.push_back(NoSuchAvatar(ref.index, ref.avatar));
      continue;
    }
    is_order_known_ = false;
    ++result.accepted;
    if (events_wanted_) AddEvent(EventType::kRemoved, ref.avatar, tick);
  }
  budget_.Release(*world_, result.accepted);
}

void WorldShard::Cancel(const CancelPart& part, CommandResult& result) {
  for (const AvatarRef& ref : part.avatars) {
    const auto it = avatars_.find(ref.avatar);
    if (it == avatars_.end()) {
      result.items.push_back(NoSuchAvatar(ref.index, ref.avatar));
      continue;
    }
    it->second.avatar.CancelQueue();
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
                                    .is_on = !asked.is_off,
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
    } else if (const Status status = it->second.avatar.SetFootPlanting(part.is_on); !status) {
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
  const std::size_t removed = std::erase_if(avatars_, [&](const auto& item) {
    if (item.second.owner != session) return false;
    if (events_wanted_) AddEvent(EventType::kRemoved, item.first, tick);
    return true;
  });
  is_order_known_ = false;
  budget_.Release(*world_, static_cast<std::int64_t>(removed));
}

void WorldShard::ChangeGround(std::uint64_t tick) {
  while (!grounds_.empty() && grounds_.front().tick <= tick) {
    ground_ = std::move(grounds_.front().ground);
    grounds_.pop_front();
    for (auto& [number, entry] : avatars_) entry.avatar.SetTerrain(terrain());
  }
}

void WorldShard::Advance(std::uint64_t tick, int steps) {
  // Ticks that are made up for have the ground of their own time.
  while (steps > 1 && !grounds_.empty() && grounds_.front().tick <= tick) {
    const std::uint64_t first = tick - static_cast<std::uint64_t>(steps) + 1;
    const std::uint64_t change = grounds_.front().tick;
    if (change <= first) {
      ChangeGround(first);
      continue;
    }
    AdvanceAvatars(change - 1, static_cast<int>(change - first));
    steps = static_cast<int>(tick - change) + 1;
  }
  ChangeGround(tick);
  AdvanceAvatars(tick, steps);
}

std::span<const WorldShard::InOrder> WorldShard::AvatarsInOrder() {
  if (!is_order_known_) {
    in_order_.clear();
    advancing_.clear();
    for (auto& [number, entry] : avatars_) {
      in_order_.push_back({number, &entry});
      advancing_.push_back(&entry.avatar);
    }
    is_order_known_ = true;
  }
  return in_order_;
}

void WorldShard::AdvanceAvatars(std::uint64_t tick, int steps) {
  const double step_s = clock_.tick_s();
  const std::span<const InOrder> in_order = AvatarsInOrder();
  for (int step = 1; step <= steps; ++step) {
    Avatar::AdvanceAll(advancing_, step_s);
    const std::uint64_t step_tick = tick - static_cast<std::uint64_t>(steps - step);
    for (const auto& [number, entry] : in_order) {
      entry->time_s += step_s;
      if (!events_wanted_) continue;
      for (const AvatarEvent& happened : entry->avatar.events()) {
        protocol::Event& event = events_.emplace_back(ToWire(happened, *world_->library));
        event.avatar = number;
        event.tick = step_tick;
        event.time_s = clock_.TickTime(step_tick) - (entry->time_s - happened.time_s);
      }
    }
  }
}

void WorldShard::SetInterest(const Interest& interest) {
  interests_[static_cast<std::size_t>(interest.shard)] = {
      {interest.every_full, interest.every_quantised}, interest.events};
  events_wanted_ = false;
  max_every_ = 1;
  std::array<bool, 2> observed{};
  for (const ShardInterest& shard : interests_) {
    events_wanted_ |= shard.events;
    for (std::size_t mode = 0; mode < 2; ++mode) {
      observed[mode] |= shard.every[mode] > 0;
      max_every_ = std::max(max_every_, shard.every[mode]);
    }
  }
  for (std::size_t mode = 0; mode < 2; ++mode) {
    if (!observed[mode]) last_batch_had_avatars_[mode] = false;
  }
}

bool WorldShard::WantsEvents(int shard) const {
  return interests_[static_cast<std::size_t>(shard)].events;
}

bool WorldShard::WantsPoses(int shard, PoseMode mode, std::uint64_t tick) const {
  const std::uint16_t every = interests_[static_cast<std::size_t>(shard)].every[ModeIndex(mode)];
  return every > 0 && tick % every == 0;
}

bool WorldShard::HasInterest() const {
  return std::ranges::any_of(interests_, [](const ShardInterest& shard) {
    return shard.events || shard.every[0] > 0 || shard.every[1] > 0;
  });
}

std::shared_ptr<const std::vector<protocol::Event>> WorldShard::TakeEvents() {
  if (events_.empty()) return nullptr;
  return std::make_shared<const std::vector<protocol::Event>>(std::exchange(events_, {}));
}

protocol::AvatarState WorldShard::Inspect(AvatarNumber avatar, std::uint64_t tick,
                                          std::size_t max_site_bytes) const {
  protocol::AvatarState state;
  const auto it = avatars_.find(avatar);
  if (it == avatars_.end()) {
    state.code = StatusCode::kNoSuchAvatar;
    state.text = "no avatar of that number";
  } else {
    const Entry& entry = it->second;
    state = server::Inspect(entry.avatar, max_site_bytes);
    if (state.movement) {
      state.movement->started_s += clock_.TickTime(tick) - entry.time_s;
    }
    for (protocol::RequestItem& item : state.queue) item.avatar = avatar;
  }
  state.world = world_->id;
  state.avatar = avatar;
  state.tick = tick;
  state.server_time_s = clock_.TickTime(tick);
  return state;
}

bool WorldShard::Encode(PoseMode mode, std::uint64_t tick, protocol::PoseBatchEncoder& encoder,
                        PoseDelivery& delivery) {
  bool& had_avatars = last_batch_had_avatars_[ModeIndex(mode)];
  if (avatars_.empty() && !had_avatars) return false;
  had_avatars = !avatars_.empty();

  const auto joint_count = static_cast<std::size_t>(world_->library->skeleton().joint_count());
  const std::size_t max_avatars = encoder.MaxAvatars(mode, joint_count);
  STRIDEWIRE_CHECK(max_avatars > 0);  // the smallest frame limit holds several of kMaxJoints
  const std::size_t parts = std::clamp<std::size_t>(
      (avatars_.size() + max_avatars - 1) / max_avatars, 1, protocol::kMaxBatchParts);
  // Only a frame limit far below the default leaves some that fit in no part.
  metrics_.pose_errors.Add(avatars_.size() - std::min(avatars_.size(), parts * max_avatars));
  protocol::PoseBatchInfo info{.world = world_->id,
                               .shard = static_cast<std::uint16_t>(shard_),
                               .parts = static_cast<std::uint16_t>(parts),
                               .tick = tick,
                               .server_time_s = clock_.TickTime(tick),
                               .mode = mode,
                               .joint_count = static_cast<std::uint16_t>(joint_count)};
  delivery.world = world_->id;
  delivery.mode = mode;
  delivery.from_shard = shard_;
  delivery.tick = tick;
  delivery.avatar_count = static_cast<std::uint32_t>(avatars_.size());
  constexpr std::size_t kAhead = 4;
  const std::span<const InOrder> in_order = AvatarsInOrder();
  std::size_t next = 0;
  for (std::size_t part = 0; part < parts; ++part) {
    info.part = static_cast<std::uint16_t>(part);
    const Status begun = encoder.Begin(info);
    STRIDEWIRE_CHECK(begun.has_value());
    for (std::size_t i = 0; i < max_avatars && next < in_order.size(); ++i, ++next) {
      const auto& [number, avatar_entry] = in_order[next];
      const Entry& entry = *avatar_entry;
      // In two strides: where a pose lies is told by the avatar.
      if (next + 2 * kAhead < in_order.size()) {
        in_order[next + 2 * kAhead].entry->avatar.PrefetchWhereShown();
      }
      if (next + kAhead < in_order.size()) in_order[next + kAhead].entry->avatar.PrefetchShown();
      std::uint8_t flags = 0;
      // Long enough to stand in a batch of the observer who takes the fewest.
      if (tick < entry.spawn_tick + max_every_) flags |= protocol::kPoseDiscontinuity;
      if (entry.avatar.idle()) flags |= protocol::kPoseStanding;
      const ConstPoseSpan pose = entry.avatar.pose();
      if (!encoder.Add(number, flags, pose.root_position_m, pose.rotations)) {
        metrics_.pose_errors.Add();
      }
    }
    metrics_.poses_encoded.Add(encoder.size());
    auto frame = std::make_shared<std::vector<std::byte>>();
    // Room for headers, numbers and flags beside the poses: grown once, never again.
    frame->reserve(encoder.size() * (protocol::PoseBytes(mode, joint_count) + 5) + 256);
    const Status finished = encoder.Finish(*frame);
    STRIDEWIRE_CHECK(finished.has_value());
    delivery.parts.push_back(std::move(frame));
  }
  return true;
}

}  // namespace stridewire::server
