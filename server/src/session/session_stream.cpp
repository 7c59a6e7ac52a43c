// The part of a session that tells its client of poses and events.

#include <algorithm>
#include <utility>

#include "session/encode_frame.h"
#include "session/session.h"
#include "world/pose_frames.h"

namespace stridewire::server {

using protocol::PoseMode;

namespace {

// An event takes under 512 bytes of a frame, so this many stay below the smallest frame limit.
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

const std::vector<SharedFrame>& SharedEvents::frames() {
  if (frames_.empty()) {
    ForEachEventFrame(delivery_, [this](protocol::Events&& message) {
      if (auto frame = EncodeFrame(encoder_, message)) frames_.push_back(std::move(frame));
    });
  }
  return frames_;
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

std::span<const AvatarId> Session::Named(WorldId world, PoseMode mode) const {
  return connection_ == nullptr ? std::span<const AvatarId>()
                                : subscriptions_.Named(world, mode);
}

std::optional<RegionFilter> Session::ReachOf(WorldId world, PoseMode mode) const {
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
      TellRegion(delivery.world, delivery.tick, change);
      if (!change.due.empty()) SendPoses(poses.ComposeShared(change.due));
      return;
  }
}

void Session::TellRegion(WorldId world, std::uint64_t tick, const RegionMembers::Change& change) {
  const std::size_t count = change.left.size() + change.entered.size();
  if (count == 0) return;
  std::vector<protocol::Event> events;
  events.reserve(count);
  const auto add = [&](protocol::EventType type, std::span<const AvatarId> avatars) {
    for (const AvatarId avatar : avatars) {
      events.push_back(
          {.type = type, .avatar = avatar, .tick = tick, .time_s = host_.clock().TickTime(tick)});
    }
  };
  add(protocol::EventType::kLeft, change.left);
  add(protocol::EventType::kEntered, change.entered);
  const EventDelivery own{world, tick,
                          std::make_shared<const std::vector<protocol::Event>>(std::move(events))};
  std::uint64_t dropped = 0;
  ForEachEventFrame(
      own, [&](protocol::Events&& message) { dropped += SendNumbered(std::move(message)); });
  CountDropped(world, dropped);
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
