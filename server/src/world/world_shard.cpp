#include "world/world_shard.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/check.h"
#include "runtime/avatar/movement_record.h"
#include "world/convert.h"
#include "world/id_set.h"
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

ReplyItem NoSuchAvatar(std::uint32_t index, AvatarId avatar, protocol::RequestId request = 0) {
  return {index, avatar, request, StatusCode::kNoSuchAvatar, "no avatar of that number"};
}

}  // namespace

WorldShard::WorldShard(std::shared_ptr<World> world, int shard, int shard_count, int max_queue,
                       const TickClock& clock, AvatarBudget& budget, ThreadMetrics& metrics,
                       std::size_t max_bulk_bytes, std::shared_ptr<PoseScratch> scratch)
    : world_(std::move(world)),
      shard_(shard),
      max_queue_(max_queue),
      clock_(clock),
      budget_(budget),
      metrics_(metrics),
      ahead_(
          scratch != nullptr ? std::move(scratch) : std::make_shared<PoseScratch>(world_->library),
          world_->codes == nullptr ? nullptr : &world_->codes->codecs),
      interests_(static_cast<std::size_t>(shard_count)),
      max_bulk_bytes_(max_bulk_bytes),
      ground_(world_->ground.Get()) {}

WorldShard::~WorldShard() { budget_.Release(*world_, static_cast<std::int64_t>(avatars_.size())); }

protocol::Event& WorldShard::AddEvent(EventType type, AvatarId avatar, std::uint64_t tick) {
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
        } else if constexpr (std::is_same_v<T, TerrainPart>) {
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
    const AvatarId number = item.spawn.avatar;
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
    avatars_.emplace(number, Entry{.avatar = AvatarSimulation(world_->library, start, options),
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
  auto it = avatars_.end();
  for (const RequestPart::Item& item : part.items) {
    const protocol::RequestItem& asked = item.request;
    // A crowd is mostly listed in order, the movements of one avatar beside each other.
    if (it != avatars_.end() && it->first != asked.avatar) ++it;
    if (it == avatars_.end() || it->first != asked.avatar) it = avatars_.find(asked.avatar);
    if (it == avatars_.end()) {
      result.items.push_back(NoSuchAvatar(item.index, asked.avatar, asked.request_id));
      continue;
    }
    AvatarSimulation& avatar = it->second.avatar;
    const std::uint32_t delay_ticks = StartTickOf(asked.avatar, part.over_ticks);
    held += delay_ticks > 0;
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
    Gone(ref.avatar);
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
                                    .enabled = !asked.is_off,
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
  const std::size_t removed = std::erase_if(avatars_, [&](const auto& item) {
    if (item.second.owner != session) return false;
    Gone(item.first);
    if (events_wanted_) AddEvent(EventType::kRemoved, item.first, tick);
    return true;
  });
  is_order_known_ = false;
  budget_.Release(*world_, static_cast<std::int64_t>(removed));
}

void WorldShard::ChangeTerrain(std::uint64_t tick) {
  while (!grounds_.empty() && grounds_.front().tick <= tick) {
    ground_ = std::move(grounds_.front().ground);
    grounds_.pop_front();
    for (auto& [number, entry] : avatars_) entry.avatar.SetTerrain(terrain());
  }
}

void WorldShard::Advance(std::uint64_t tick, int steps) {
  tick_ = tick;
  more_steps_ = static_cast<std::uint16_t>(steps);
  // Ticks that are made up for have the ground of their own time.
  while (steps > 1 && !grounds_.empty() && grounds_.front().tick <= tick) {
    const std::uint64_t first = tick - static_cast<std::uint64_t>(steps) + 1;
    const std::uint64_t change = grounds_.front().tick;
    if (change <= first) {
      ChangeTerrain(first);
      continue;
    }
    AdvanceAvatars(change - 1, static_cast<int>(change - first));
    steps = static_cast<int>(tick - change) + 1;
  }
  ChangeTerrain(tick);
  AdvanceAvatars(tick, steps);
}

std::span<const WorldShard::InOrder> WorldShard::AvatarsInOrder() {
  if (!is_order_known_) {
    in_order_.clear();
    advancing_.clear();
    std::vector<AvatarId> numbers;
    numbers.reserve(avatars_.size());
    for (auto& [number, entry] : avatars_) {
      in_order_.push_back({number, &entry});
      advancing_.push_back(&entry.avatar);
      numbers.push_back(number);
    }
    numbers_ = std::make_shared<const std::vector<AvatarId>>(std::move(numbers));
    all_rows_.resize(avatars_.size());
    std::iota(all_rows_.begin(), all_rows_.end(), 0u);
    is_order_known_ = true;
    are_named_rows_known_ = false;
  }
  return in_order_;
}

void WorldShard::AdvanceAvatars(std::uint64_t tick, int steps) {
  const double step_s = clock_.tick_s();
  const std::span<const InOrder> in_order = AvatarsInOrder();
  for (int step = 1; step <= steps; ++step) {
    AvatarSimulation::AdvanceStates(advancing_, step_s, ahead_.plan_scratch(), &eventful_);
    ++step_;
    --more_steps_;
    if (movements_wanted_) TellMovements();
    const std::uint64_t step_tick = tick - static_cast<std::uint64_t>(steps - step);
    if (!events_wanted_) continue;
    for (const std::uint32_t row : eventful_) {
      const auto& [number, entry] = in_order[row];
      for (const AvatarEvent& happened : entry->avatar.events()) {
        protocol::Event& event = events_.emplace_back(ToWire(happened, *world_->library));
        event.avatar = number;
        event.tick = step_tick;
        event.time_s = clock_.TickTime(step_tick) - (entry->avatar.time_s() - happened.time_s);
      }
    }
  }
}

void WorldShard::SetInterest(const Interest& interest) {
  interests_[static_cast<std::size_t>(interest.shard)] = interest;
  events_wanted_ = false;
  movements_wanted_ = false;
  movement_places_wanted_ = false;
  max_every_ = 1;
  are_named_rows_known_ = false;
  std::array<bool, kSentModes.size()> observed{};
  for (const Interest& shard : interests_) {
    events_wanted_ |= shard.events;
    movements_wanted_ |= shard.movements;
    movement_places_wanted_ |= shard.movement_places;
    for (std::size_t mode = 0; mode < observed.size(); ++mode) {
      const PoseInterest::Every& every = shard.poses[mode].every;
      observed[mode] |= every.whole > 0 || every.some > 0;
      max_every_ = std::max({max_every_, every.whole, every.some});
    }
  }
  // Compact poses of ticks that somebody has a use for.
  std::vector<PoseMode> compact;
  int ticks_apart = movement_places_wanted_ ? 1 : 0;
  for (std::size_t mode = 0; mode < observed.size(); ++mode) {
    if (!observed[mode]) continue;
    if (protocol::IsCompact(kSentModes[mode])) compact.push_back(kSentModes[mode]);
    for (const Interest& shard : interests_) {
      const PoseInterest::Every& every = shard.poses[mode].every;
      ticks_apart = std::gcd(ticks_apart, std::gcd<int>(every.whole, every.some));
    }
  }
  ahead_.SetModes(compact, std::max(ticks_apart, 1));
  for (std::size_t mode = 0; mode < observed.size(); ++mode) {
    // Who wants avatars that are not here, or not any more, is told once.
    last_had_poses_[mode] =
        observed[mode] && (last_had_poses_[mode] || interest.poses[mode].every.some > 0);
  }
}

bool WorldShard::WantsEvents(int shard) const {
  return interests_[static_cast<std::size_t>(shard)].events;
}

bool WorldShard::WantsMovements(int shard) const {
  return interests_[static_cast<std::size_t>(shard)].movements;
}

WorldShard::Wish WorldShard::WishOf(int shard, PoseMode mode, std::uint64_t tick) const {
  const PoseInterest::Every& every =
      interests_[static_cast<std::size_t>(shard)].poses[ModeIndex(mode)].every;
  return {.whole = every.whole > 0 && tick % every.whole == 0,
          .some = every.some > 0 && tick % every.some == 0};
}

bool WorldShard::HasInterest() const {
  return std::ranges::any_of(interests_, [](const Interest& shard) {
    return shard.events || shard.movements ||
           std::ranges::any_of(shard.poses, [](const PoseInterest& poses) {
             return poses.every != PoseInterest::Every{};
           });
  });
}

std::shared_ptr<const std::vector<protocol::Event>> WorldShard::TakeEvents() {
  if (events_.empty()) return nullptr;
  auto events = std::make_shared<const std::vector<protocol::Event>>(std::exchange(events_, {}));
  events_.reserve(events->size());  // the next tick has about as many
  return events;
}

void WorldShard::Gone(AvatarId avatar) {
  if (movements_wanted_) gone_.push_back(avatar);
}

protocol::Movements WorldShard::EmptyMovements() const {
  return {.world = world_->id,
          .shard = static_cast<std::uint16_t>(shard_),
          .more_steps = more_steps_,
          .step = step_,
          .tick = tick_,
          .server_time_s = clock_.TickTime(tick_)};
}

// Whether another record, however long, might be more than a frame takes.
bool WorldShard::IsFull(const protocol::Movements& message) const {
  constexpr std::size_t kOverheadBytes = 256;
  constexpr std::size_t kAvatarBytes = 9;  // number, flags, end
  return message.avatars.size() == protocol::kMaxItems ||
         message.records.size() + (message.avatars.size() + 1) * kAvatarBytes + kOverheadBytes +
                 MaxRecordBytes(*world_->library) >
             max_bulk_bytes_;
}

// What the step just gone brought.
void WorldShard::TellMovements() {
  const std::span<const InOrder> in_order = AvatarsInOrder();
  if (in_order.empty() && gone_.empty() && !last_step_had_avatars_) return;
  last_step_had_avatars_ = !in_order.empty();
  const std::size_t first = movements_.size();
  movements_.push_back(EmptyMovements());
  const auto add = [&](AvatarId number, std::uint8_t flags) {
    protocol::Movements& message = movements_.back();
    message.avatars.push_back(number);
    message.flags.push_back(flags);
    message.ends.push_back(static_cast<std::uint32_t>(message.records.size()));
    if (IsFull(message)) movements_.push_back(EmptyMovements());
  };
  for (const AvatarId number : gone_) add(number, protocol::kMovementGone);
  gone_.clear();
  for (const std::uint32_t row : eventful_) {
    const auto& [number, entry] = in_order[row];
    if (!AppendChange(entry->avatar, movements_.back().records)) continue;
    const bool is_new = entry->spawn_tick == tick_ && entry->avatar.change().needs_state;
    add(number, is_new ? protocol::kPoseDiscontinuity : 0);
  }
  const std::size_t parts = movements_.size() - first;
  // Only a frame limit far below the default lets it come to that: who is told sees a gap, and
  // knows of nobody.
  if (parts > protocol::kMaxBatchParts) {
    metrics_.pose_errors.Add(in_order.size());
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
              .places = nullptr};
  if (movement_places_wanted_) {
    delivery.places = PlacesAt(tick);
    delivery.avatars = numbers_;
  }
  return true;
}

StatesAnswer WorldShard::States(const StatesQuestion& question, protocol::Encoder& encoder) const {
  StatesAnswer answer{.world = world_->id, .from_shard = shard_};
  protocol::Movements message = EmptyMovements();
  message.states = true;
  const auto tell = [&](AvatarId number, const Entry& entry) {
    if (message.records.size() > question.enough_bytes || IsFull(message)) {
      answer.next = number;
      return;
    }
    // One that came with this tick is told with it; its state is the same.
    AppendState(entry.avatar, message.records);
    message.avatars.push_back(number);
    message.flags.push_back(0);
    message.ends.push_back(static_cast<std::uint32_t>(message.records.size()));
  };
  if (question.named == nullptr) {
    for (auto it = avatars_.lower_bound(question.first); it != avatars_.end() && answer.next == 0;
         ++it) {
      tell(it->first, it->second);
    }
  } else {
    const std::vector<AvatarId>& named = *question.named;
    for (auto number = std::ranges::lower_bound(named, question.first);
         number != named.end() && answer.next == 0; ++number) {
      if (const auto it = avatars_.find(*number); it != avatars_.end()) tell(*number, it->second);
    }
  }
  if (message.avatars.empty()) return answer;
  auto frame = std::make_shared<std::vector<std::byte>>();
  const Status status = encoder.Encode(message, *frame);
  STRIDEWIRE_CHECK(status.has_value());
  answer.frame = std::move(frame);
  return answer;
}

protocol::AvatarState WorldShard::Inspect(AvatarId avatar, std::uint64_t tick,
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

std::span<const std::uint32_t> WorldShard::NamedRows(PoseMode mode) {
  if (!are_named_rows_known_) {
    are_named_rows_known_ = true;
    for (std::size_t m = 0; m < named_rows_.size(); ++m) {
      IdSet named;
      for (const Interest& shard : interests_) {
        if (shard.poses[m].named != nullptr) named.Add(*shard.poses[m].named);
      }
      named_rows_[m].clear();
      auto from = numbers_->begin();
      for (const AvatarId number : named.Take()) {
        from = std::lower_bound(from, numbers_->end(), number);
        if (from == numbers_->end()) break;
        if (*from == number) {
          named_rows_[m].push_back(static_cast<std::uint32_t>(from - numbers_->begin()));
        }
      }
    }
  }
  return named_rows_[ModeIndex(mode)];
}

bool WorldShard::HasRegions(PoseMode mode) const {
  return std::ranges::any_of(interests_, [&](const Interest& shard) {
    const auto& regions = shard.poses[ModeIndex(mode)].regions;
    return regions != nullptr && !regions->empty();
  });
}

bool WorldShard::HasRegionsOfSeveral(PoseMode mode) const {
  return std::ranges::any_of(interests_, [&](const Interest& shard) {
    const auto& regions = shard.poses[ModeIndex(mode)].regions;
    return regions != nullptr && std::ranges::any_of(*regions, &RegionFilter::is_one_of_several);
  });
}

// Sees to it that these rows' avatars have their encoded poses of this step, and perhaps of some to
// come.
void WorldShard::KeepPoses(std::span<const std::uint32_t> rows) {
  constexpr std::size_t kAhead = 16;
  const std::span<const InOrder> in_order = AvatarsInOrder();
  ahead_.Begin(step_, clock_.tick_s(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + kAhead < rows.size()) {
      Prefetch(*in_order[rows[i + kAhead]].entry);
    }
    Entry& entry = *in_order[rows[i]].entry;
    ahead_.Ask(entry.ahead, entry.avatar);
  }
  ahead_.Finish();
}

// Evaluates the poses of these rows' avatars.
void WorldShard::UpdatePoses(std::span<const std::uint32_t> rows) {
  const std::span<const InOrder> in_order = AvatarsInOrder();
  shown_.clear();
  for (const std::uint32_t row : rows) shown_.push_back(&in_order[row].entry->avatar);
  AvatarSimulation::UpdatePoses(shown_, ahead_.evaluator());
}

std::shared_ptr<const SpatialGrid> WorldShard::PlacesAt(std::uint64_t tick) {
  if (places_ != nullptr && places_tick_ == tick) return places_;
  const std::span<const InOrder> in_order = AvatarsInOrder();
  auto places = std::make_shared<SpatialGrid>();
  places->Begin(world_->interest_cell_m, in_order.size());
  KeepPoses(all_rows_);
  for (std::size_t i = 0; i < in_order.size(); ++i) {
    const Vec3 root_m = ahead_.RootOf(in_order[i].entry->ahead);
    places->Add(static_cast<std::uint32_t>(i), root_m.x, root_m.z);
  }
  places->Sort();
  places_ = std::move(places);
  places_tick_ = tick;
  return places_;
}

std::span<const std::uint32_t> WorldShard::NamedAndNearRows(PoseMode mode,
                                                            const SpatialGrid& places) {
  is_near_.resize(numbers_->size());
  near_rows_.clear();
  const auto take = [&](std::uint32_t row) {
    if (std::exchange(is_near_[row], 1) == 0) near_rows_.push_back(row);
  };
  for (const std::uint32_t row : NamedRows(mode)) take(row);
  for (const Interest& shard : interests_) {
    const auto& regions = shard.poses[ModeIndex(mode)].regions;
    if (regions == nullptr) continue;
    for (const RegionFilter& region : *regions) {
      const double beyond_m2 = region.beyond_m * region.beyond_m;
      const auto take_beyond = [&](std::uint32_t row, double x, double z) {
        // Told as RegionMembers tells in which ring one is.
        const double distance_m2 =
            (x - region.x) * (x - region.x) + (z - region.z) * (z - region.z);
        if (region.beyond_m == 0.0 || distance_m2 > beyond_m2) take(row);
      };
      places.ForEachNear(region.x, region.z, region.reach_m, take_beyond);
    }
  }
  for (const std::uint32_t row : near_rows_) is_near_[row] = 0;
  std::ranges::sort(near_rows_);
  return near_rows_;
}

bool WorldShard::Encode(PoseMode mode, std::uint64_t tick, bool whole,
                        protocol::PoseBatchComposer& composer, PoseDelivery& delivery) {
  const std::span<const InOrder> in_order = AvatarsInOrder();
  delivery.places = HasRegions(mode) ? PlacesAt(tick) : nullptr;
  const std::span<const std::uint32_t> wanted = whole ? std::span<const std::uint32_t>(all_rows_)
                                                : delivery.places != nullptr
                                                    ? NamedAndNearRows(mode, *delivery.places)
                                                    : NamedRows(mode);
  bool& had_poses = last_had_poses_[ModeIndex(mode)];
  if (wanted.empty() && !had_poses && !HasRegionsOfSeveral(mode)) return false;
  had_poses = !wanted.empty();

  protocol::PoseRows& rows = rows_[ModeIndex(mode)].Take();
  const Status begun = rows.Begin(
      {.world = world_->id,
       .shard = static_cast<std::uint16_t>(shard_),
       .tick = tick,
       .server_time_s = clock_.TickTime(tick),
       .mode = mode,
       .joint_count = static_cast<std::uint16_t>(world_->library->skeleton().joint_count())},
      numbers_, world_->codes == nullptr ? nullptr : world_->codes->codecs.Find(mode));
  STRIDEWIRE_CHECK(begun.has_value());
  const bool is_compact = protocol::IsCompact(mode);
  if (is_compact) {
    KeepPoses(wanted);
  } else {
    UpdatePoses(wanted);
  }
  constexpr std::size_t kAhead = 16;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const Entry& entry = *in_order[wanted[i]].entry;
    if (i + kAhead < wanted.size()) Prefetch(*in_order[wanted[i + kAhead]].entry);
    std::uint8_t flags = 0;
    // Long enough to stand in a batch of the observer who takes the fewest.
    if (tick < entry.spawn_tick + max_every_) flags |= protocol::kPoseDiscontinuity;
    if (entry.avatar.idle()) flags |= protocol::kPoseStanding;
    rows.SkipTo(wanted[i]);
    if (is_compact) {
      const EncodedPoseCache::Encoded encoded = ahead_.Of(entry.ahead, mode);
      rows.AddEncoded(flags, encoded.is_wide, encoded.bytes);
    } else {
      const ConstPoseSpan pose = entry.avatar.pose();
      (void)rows.Add(flags, pose.root_position_m, pose.rotations);
    }
  }
  rows.SkipTo(in_order.size());
  metrics_.poses_encoded.Add(rows.pose_count());
  metrics_.pose_errors.Add(wanted.size() - rows.pose_count());

  delivery.world = world_->id;
  delivery.mode = mode;
  delivery.from_shard = shard_;
  delivery.tick = tick;
  delivery.avatar_count = static_cast<std::uint32_t>(rows.pose_count());
  delivery.parts.clear();
  if (whole) delivery.parts = ComposeFrames(composer, rows, wanted, false, metrics_);
  delivery.rows = rows_[ModeIndex(mode)].Share();
  return true;
}

}  // namespace stridewire::server
