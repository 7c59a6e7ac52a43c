// The part of SessionStream that sends movements to clients that evaluate poses themselves.

#include <algorithm>
#include <iterator>

#include "base/check.h"
#include "session/session_stream.h"

namespace stridewire::server {

using protocol::PoseMode;

namespace {

// Approximate size of the states that a shard sends per request.
constexpr std::size_t kStatesBytes = 100'000;

// Maximum time for which movements wait for a tick that the client evaluates.
constexpr double kMaxWaitS = 0.1;

}  // namespace

const std::vector<SharedFrame>& SharedMovements::frames() {
  if (frames_.empty()) {
    for (const protocol::Movements& step : *delivery_.steps) {
      frames_.push_back(EncodeFrame(encoder_, step));
    }
  }
  return frames_;
}

const SharedFrame& SharedMovements::EmptyFrame(std::size_t i, const protocol::Movements& empty) {
  STRIDEWIRE_CHECK(empty.avatars.empty() && i < delivery_.steps->size());
  empty_frames_.resize(delivery_.steps->size());
  if (empty_frames_[i] == nullptr) empty_frames_[i] = EncodeFrame(encoder_, empty);
  return empty_frames_[i];
}

void SessionStream::UpdateMovementFeeds(const std::shared_ptr<World>& world) {
  const std::span<const AvatarId> selected =
      subscriptions_.SelectedAvatars(world->id, PoseMode::kMovement);
  RegionMembers* region = subscriptions_.FindRegion(world->id, PoseMode::kMovement);
  const int shard_count = context_.host.shard_count();
  for (int shard = 0; shard < shard_count; ++shard) {
    MovementFeed& feed = movement_feeds_.try_emplace({world->id, shard}, world).first->second;
    if (region != nullptr) {
      feed.SetAvatars(region->members(shard));
      continue;
    }
    if (selected.empty()) {
      feed.SetAvatars(std::nullopt);
      continue;
    }
    std::vector<AvatarId> of_shard;
    std::ranges::copy_if(selected, std::back_inserter(of_shard),
                         [&](AvatarId id) { return ShardOf(id, shard_count) == shard; });
    feed.SetAvatars(std::move(of_shard));
  }
  RequestStates();
}

void SessionStream::EndMovementFeeds(WorldId world) {
  std::erase_if(movement_feeds_, [&](const auto& item) { return item.first.first == world; });
  if (context_.connection != nullptr) context_.connection->DropMovements(world);
}

void SessionStream::RequestStates() {
  if (context_.connection == nullptr) return;
  const std::size_t waiting = context_.connection->queue().movement_bytes();
  // States may fill only a small part of the buffer; the rest is for movements.
  const std::size_t max_waiting = context_.host.config().limits.control_buffer_bytes / 16;
  for (auto& [key, feed] : movement_feeds_) {
    if (feed.is_lost() && waiting == 0) feed.Restart();
    if (!feed.needs_request() || waiting > max_waiting) continue;
    if (++states_nonce_ == 0) ++states_nonce_;
    StatesRequest request{.from_shard = context_.host.shard_index(),
                          .session = context_.identity.id,
                          .enough_bytes = std::min(kStatesBytes, max_waiting)};
    feed.NextRequest(states_nonce_, request);
    context_.host.SendToShard(key.second, std::move(request));
  }
}

void SessionStream::SendMovements(WorldId world, int shard, MovementFeed& feed,
                                  const SharedFrame& frame, double wait_s) {
  if (context_.connection == nullptr || feed.is_lost() || frame == nullptr) return;
  const std::size_t dropped = context_.connection->SendMovements(world, shard, frame, wait_s);
  if (dropped == 0) return;
  feed.SetLost();
  CountDroppedBatches(world, dropped);
}

void SessionStream::OnMovements(SharedMovements& movements) {
  const MovementDelivery& delivery = movements.delivery();
  const auto it = movement_feeds_.find({delivery.world, delivery.from_shard});
  if (it == movement_feeds_.end()) return;
  MovementFeed& feed = it->second;
  const SendInterval interval = IntervalOf(delivery.world, PoseMode::kMovement);
  const std::uint64_t every_n_ticks = std::max(interval.all, interval.subset);
  const bool is_due = every_n_ticks == 0 || delivery.tick % every_n_ticks == 0;
  const bool waits = context_.host.config().limits.websocket_gather_s > 0.0;
  const double wait_s = is_due || !waits ? GatherTime() : kMaxWaitS;
  for (std::size_t i = 0; i < delivery.steps->size() && !feed.is_lost(); ++i) {
    if (feed.covers_all()) {
      SendMovements(delivery.world, delivery.from_shard, feed, movements.frames()[i], wait_s);
      continue;
    }
    const protocol::Movements selected =
        feed.Select((*delivery.steps)[i], context_.host.config().limits.max_bulk_bytes);
    SendMovements(delivery.world, delivery.from_shard, feed,
                  selected.avatars.empty() ? movements.EmptyFrame(i, selected)
                                           : EncodeFrame(context_.host.encoder(), selected),
                  wait_s);
  }
  if (is_due && wait_s > 0.0) OnGathered(delivery.tick, delivery.from_shard);
  RegionMembers* region = subscriptions_.FindRegion(delivery.world, PoseMode::kMovement);
  // The grid is null until the shard has received the region.
  if (region != nullptr && delivery.grid != nullptr) {
    const RegionMembers::Change change = region->Update(delivery);
    if (!change.entered.empty() || !change.left.empty()) {
      feed.SetAvatars(region->members(delivery.from_shard));
      SendRegionChange(delivery.world, delivery.tick, change);
    }
  }
  // OnSent, which usually restarts lost feeds, is not called while the send queue is empty.
  RequestStates();
}

void SessionStream::OnStates(const StatesResult& result) {
  const auto it = movement_feeds_.find({result.world, result.from_shard});
  if (it == movement_feeds_.end() || !it->second.OnStates(result)) return;
  if (result.frame != nullptr) {
    SendMovements(result.world, result.from_shard, it->second, result.frame, GatherTime());
  }
  RequestStates();
}

}  // namespace stridewire::server
