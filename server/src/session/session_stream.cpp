// Poses, events and terrain; see session_movements.cpp for movements.
#include "session/session_stream.h"

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "world/pose_frames.h"

namespace stridewire::server {

using protocol::PoseMode;

namespace {

// An event takes less than 512 bytes, so this many fit into a frame with the smallest limit.
constexpr std::size_t kEventsPerFrame = 100;

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

PoseDelivery SharedPoses::Compose(std::span<const std::uint32_t> rows, bool is_partial) {
  PoseDelivery batch{.world = delivery_.world,
                     .mode = delivery_.mode,
                     .from_shard = delivery_.from_shard,
                     .tick = delivery_.tick,
                     .avatar_count = static_cast<std::uint32_t>(rows.size()),
                     .parts = ComposeFrames(composer_, *delivery_.rows, rows, is_partial, metrics_),
                     .rows = nullptr,
                     .grid = nullptr};
  metrics_.batches_composed.Add(batch.parts.size());
  return batch;
}

const PoseDelivery& SharedPoses::ComposeShared(std::span<const std::uint32_t> rows) {
  const auto [it, is_new] =
      shared_.try_emplace(std::vector<std::uint32_t>(rows.begin(), rows.end()));
  if (is_new) it->second = Compose(rows, true);
  return it->second;
}

SessionStream::SessionStream(SessionContext& context)
    : context_(context), event_replay_(context.host.config().limits.event_replay_bytes) {}

// ---- what the session needs

bool SessionStream::WantsEvents(WorldId world) const {
  const Membership* membership = context_.FindWorld(world);
  if (membership == nullptr) return false;
  return membership->role == protocol::Role::kController || subscriptions_.WantsEvents(world);
}

SendInterval SessionStream::IntervalOf(WorldId world, PoseMode mode) const {
  return context_.connection == nullptr ? SendInterval{} : subscriptions_.IntervalOf(world, mode);
}

std::span<const AvatarId> SessionStream::SelectedAvatars(WorldId world, PoseMode mode) const {
  return context_.connection == nullptr ? std::span<const AvatarId>()
                                        : subscriptions_.SelectedAvatars(world, mode);
}

std::optional<RegionFilter> SessionStream::FilterOf(WorldId world, PoseMode mode) const {
  return context_.connection == nullptr ? std::nullopt : subscriptions_.FilterOf(world, mode);
}

// ---- begin and end

void SessionStream::Resume(std::uint64_t last_events_number) {
  STRIDEWIRE_CHECK(context_.connection != nullptr);
  subscriptions_.RepeatEmptyBatches();
  // Events may have been lost with the previous connection, so they are sent again.
  event_replay_.ForEachAfter(last_events_number, [this](EventReplay::Stored& stored) {
    stored.was_sent = context_.connection->SendEvents(stored.frame);
    if (!stored.was_sent) context_.host.metrics().events_dropped.Add(stored.event_count);
  });
  for (auto& [id, membership] : context_.worlds) {
    membership.reported_drops = 0;
    SendLagging(membership);
  }
  movement_feeds_.clear();
  for (auto& [id, membership] : context_.worlds) {
    context_.host.InterestChanged(membership.world);
    if (subscriptions_.Observes(id, PoseMode::kMovement)) UpdateMovementFeeds(membership.world);
  }
}

void SessionStream::LeaveWorld(WorldId world) {
  subscriptions_.RemoveWorld(world);
  EndMovementFeeds(world);
  if (context_.connection == nullptr) return;
  for (const PoseMode mode : kSentModes) context_.connection->DropPoses(world, mode);
  context_.connection->DropTerrain(world);
}

std::optional<WorldId> SessionStream::RemoveSubscription(protocol::SubscriptionId id) {
  const auto removed = subscriptions_.Remove(id);
  if (!removed) return std::nullopt;
  const WorldId world = removed->world;
  if (removed->mode == PoseMode::kMovement) {
    if (subscriptions_.Observes(world, PoseMode::kMovement)) {
      UpdateMovementFeeds(context_.worlds.at(world).world);
    } else {
      EndMovementFeeds(world);
    }
  } else if (context_.connection != nullptr) {
    for (const PoseMode mode : kSentModes) {
      if (!subscriptions_.Observes(world, mode)) context_.connection->DropPoses(world, mode);
    }
  }
  return world;
}

// ---- poses

void SessionStream::OnPoses(SharedPoses& poses) {
  if (context_.connection == nullptr) return;
  const PoseDelivery& delivery = poses.delivery();
  switch (subscriptions_.ShareOf(delivery)) {
    case Subscriptions::Share::kNone: return;
    case Subscriptions::Share::kAll:
      // Empty until the shard has received the request for complete batches.
      if (!delivery.parts.empty()) SendPoses(delivery, delivery.parts);
      return;
    case Subscriptions::Share::kSubset:
      if (const auto rows = subscriptions_.PickRows(delivery)) {
        PoseDelivery batch = poses.Compose(*rows, false);
        SendPoses(batch, std::move(batch.parts));
      }
      return;
    case Subscriptions::Share::kRegion:
      // Null until the shard has received the region.
      if (delivery.grid == nullptr) return;
      const RegionMembers::Change change = subscriptions_.UpdateRegion(delivery);
      SendRegionChange(delivery.world, delivery.tick, change);
      if (!change.due.empty()) {
        const PoseDelivery& batch = poses.ComposeShared(change.due);
        SendPoses(batch, batch.parts);
      }
      return;
  }
}

void SessionStream::SendPoses(const PoseDelivery& delivery, std::vector<SharedFrame> frames) {
  const double wait_s = GatherTime();
  CountDroppedBatches(delivery.world,
                      context_.connection->SendPoses({.world = delivery.world,
                                                      .mode = delivery.mode,
                                                      .shard = delivery.from_shard,
                                                      .avatar_count = delivery.avatar_count,
                                                      .frames = std::move(frames)},
                                                     wait_s));
  if (wait_s > 0.0) OnGathered(delivery.tick, delivery.from_shard);
}

double SessionStream::GatherTime() const {
  if (context_.connection == nullptr || context_.connection->kind() != TransportKind::kWebSocket ||
      context_.host.shard_count() == 1) {
    return 0.0;
  }
  // The limit of half a tick ensures that batches are sent before those of the next tick.
  return std::min(context_.host.config().limits.websocket_gather_s,
                  0.5 / context_.host.config().tick_hz);
}

void SessionStream::OnGathered(std::uint64_t tick, int shard) {
  if (tick < gathered_tick_) return;
  if (tick > gathered_tick_ || gathered_.empty()) {
    gathered_tick_ = tick;
    gathered_.assign(static_cast<std::size_t>(context_.host.shard_count()), false);
  }
  gathered_[static_cast<std::size_t>(shard)] = true;
  if (std::ranges::find(gathered_, false) == gathered_.end()) context_.connection->EndWait();
}

void SessionStream::CountDroppedBatches(WorldId world, std::uint64_t batches) {
  if (batches == 0) return;
  context_.worlds.at(world).dropped_batches += batches;
  context_.host.metrics().batches_dropped.Add(batches);
  context_.host.metrics().Reached(Limit::kObserverBacklog);
}

// ---- events

void SessionStream::OnEvents(const EventDelivery& delivery) {
  if (!WantsEvents(delivery.world)) return;
  std::uint64_t dropped = 0;
  ForEachEventFrame(delivery,
                    [&](protocol::Events&& message) { dropped += SendEvents(std::move(message)); });
  CountDroppedEvents(delivery.world, dropped);
}

void SessionStream::SendRegionChange(WorldId world, std::uint64_t tick,
                                     const RegionMembers::Change& change) {
  const std::size_t count = change.left.size() + change.entered.size();
  if (count == 0) return;
  std::vector<protocol::Event> events;
  events.reserve(count);
  const auto add = [&](protocol::EventType type, std::span<const AvatarId> avatars) {
    for (const AvatarId avatar : avatars) {
      events.push_back({.type = type,
                        .avatar = avatar,
                        .tick = tick,
                        .time_s = context_.host.clock().TickTime(tick)});
    }
  };
  add(protocol::EventType::kLeft, change.left);
  add(protocol::EventType::kEntered, change.entered);
  const EventDelivery delivery{
      world, tick, std::make_shared<const std::vector<protocol::Event>>(std::move(events))};
  std::uint64_t dropped = 0;
  ForEachEventFrame(delivery,
                    [&](protocol::Events&& message) { dropped += SendEvents(std::move(message)); });
  CountDroppedEvents(world, dropped);
}

std::uint64_t SessionStream::SendEvents(protocol::Events&& message) {
  message.number = ++events_number_;
  const SharedFrame frame = EncodeFrame(context_.host.encoder(), message);
  if (frame == nullptr) return 0;
  const bool was_sent = context_.connection != nullptr && context_.connection->SendEvents(frame);
  // If the send queue is full, the message is dropped. If it were sent later, it would be out of
  // order.
  if (context_.connection != nullptr && !was_sent) return message.events.size();
  event_replay_.Add({message.number, message.events.size(), was_sent, frame});
  const std::uint64_t dropped = event_replay_.TakeDropped();
  if (dropped > 0) context_.host.metrics().Reached(Limit::kEventReplay);
  return dropped;
}

void SessionStream::CountDroppedEvents(WorldId world, std::uint64_t events) {
  if (events == 0) return;
  if (context_.connection != nullptr) context_.host.metrics().Reached(Limit::kControlBuffer);
  // If the replay buffer drops stored messages, their events may belong to another world of the
  // session. They are counted for `world` nevertheless, because only the total over all worlds
  // matters.
  context_.worlds.at(world).dropped_events += events;
  context_.host.metrics().events_dropped.Add(events);
}

void SessionStream::SendLagging(Membership& membership) {
  const std::uint64_t dropped = membership.dropped_batches + membership.dropped_events;
  STRIDEWIRE_CHECK(membership.reported_drops <= dropped);
  if (context_.connection == nullptr || dropped == membership.reported_drops) return;
  membership.reported_drops = dropped;
  context_.Send(protocol::Lagging{.world = membership.world->id,
                                  .dropped_batches = membership.dropped_batches,
                                  .dropped_events = membership.dropped_events});
}

// ---- terrain

void SessionStream::OnTerrain(WorldId world, const SharedFrame& frame) {
  if (context_.connection == nullptr) return;
  if (context_.worlds.contains(world)) context_.connection->SendTerrain(world, frame);
}

void SessionStream::SendTerrain(const World& world, bool even_if_flat) {
  if (context_.connection == nullptr) return;
  if (const auto terrain = world.terrain.Get()) {
    context_.connection->SendTerrain(world.id, terrain->frame);
  } else if (even_if_flat) {
    context_.Send(protocol::WorldTerrain{.world = world.id, .terrain = {}});
  }
}

}  // namespace stridewire::server
