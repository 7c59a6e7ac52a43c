// The part of a session that tells what avatars begin, and gives out their library, to a client that evaluates the poses itself.

#include <algorithm>
#include <iterator>

#include "session/encode_frame.h"
#include "session/session.h"

namespace stridewire::server {

using protocol::StatusCode;

namespace {

// States are asked for this much at a time, of each shard.
constexpr std::size_t kStatesBytes = 100'000;

}  // namespace

const std::vector<SharedFrame>& SharedMovements::frames() {
  if (frames_.empty()) {
    for (const protocol::Movements& step : *delivery_.steps) {
      frames_.push_back(EncodeFrame(encoder_, step));
    }
  }
  return frames_;
}

const SharedFrame& SharedMovements::Empty(std::size_t i, const protocol::Movements& empty) {
  empty_.resize(delivery_.steps->size());
  if (empty_[i] == nullptr) empty_[i] = EncodeFrame(encoder_, empty);
  return empty_[i];
}

// Others are to be told of, or the client knows of nobody yet.
void Session::WatchMovements(const std::shared_ptr<World>& world) {
  const std::span<const AvatarId> named =
      subscriptions_.Named(world->id, protocol::PoseMode::kMovement);
  RegionMembers* region = subscriptions_.RegionOf(world->id, protocol::PoseMode::kMovement);
  for (int shard = 0; shard < host_.shard_count(); ++shard) {
    MovementFeed& feed = movement_feeds_.try_emplace({world->id, shard}, world).first->second;
    if (region != nullptr) {
      feed.Watch(region->inside(shard));
      continue;
    }
    if (named.empty()) {
      feed.Watch(std::nullopt);
      continue;
    }
    std::vector<AvatarId> there;
    std::ranges::copy_if(named, std::back_inserter(there), [&](AvatarId number) {
      return ShardOf(number, host_.shard_count()) == shard;
    });
    feed.Watch(std::move(there));
  }
  AskForStates();
}

void Session::EndMovements(WorldId world) {
  std::erase_if(movement_feeds_, [&](const auto& item) { return item.first.first == world; });
  if (connection_ != nullptr) connection_->DropMovements(world);
}

void Session::AskForStates() {
  if (connection_ == nullptr) return;
  const std::size_t waiting = connection_->queue().movement_bytes();
  // States alone never are more than the budget.
  const std::size_t little = host_.config().limits.control_buffer_bytes / 16;
  for (auto& [key, feed] : movement_feeds_) {
    if (feed.is_lost() && waiting == 0) feed.Recover();
    if (!feed.asks() || waiting > little) continue;
    if (++states_nonce_ == 0) ++states_nonce_;
    StatesQuestion question{.from_shard = host_.shard_index(),
                            .session = identity_.id,
                            .enough_bytes = std::min(kStatesBytes, little)};
    feed.Ask(states_nonce_, question);
    host_.Ask(key.second, std::move(question));
  }
}

void Session::OnSent() {
  UpdatePause();
  AskForStates();
}

void Session::SendMovements(WorldId world, int shard, MovementFeed& feed,
                            const SharedFrame& frame) {
  if (connection_ == nullptr || feed.is_lost() || frame == nullptr) return;
  const std::size_t dropped = connection_->SendMovements(world, shard, frame);
  if (dropped == 0) return;
  feed.Lose();
  worlds_.at(world).dropped_batches += dropped;
  host_.metrics().batches_dropped.Add(dropped);
  host_.metrics().Reached(Limit::kObserverBacklog);
}

void Session::OnMovements(SharedMovements& movements) {
  const MovementDelivery& delivery = movements.delivery();
  const auto it = movement_feeds_.find({delivery.world, delivery.from_shard});
  if (it == movement_feeds_.end()) return;
  MovementFeed& feed = it->second;
  for (std::size_t i = 0; i < delivery.steps->size() && !feed.is_lost(); ++i) {
    if (feed.is_whole()) {
      SendMovements(delivery.world, delivery.from_shard, feed, movements.frames()[i]);
      continue;
    }
    const protocol::Movements some =
        feed.Pick((*delivery.steps)[i], host_.config().limits.max_bulk_bytes);
    SendMovements(
        delivery.world, delivery.from_shard, feed,
        some.avatars.empty() ? movements.Empty(i, some) : EncodeFrame(host_.encoder(), some));
  }
  RegionMembers* region = subscriptions_.RegionOf(delivery.world, protocol::PoseMode::kMovement);
  // No places: the shard has not heard yet that there is a region.
  if (region != nullptr && delivery.places != nullptr) {
    const RegionMembers::Change change =
        region->Update(delivery.from_shard, delivery.tick, delivery.avatars, *delivery.places);
    if (!change.entered.empty() || !change.left.empty()) {
      feed.Watch(region->inside(delivery.from_shard));
      TellRegion(delivery.world, delivery.tick, change);
    }
  }
  // Nothing waits to be sent any more, so OnSent did not come: a feed that was lost goes on from here.
  AskForStates();
}

void Session::OnStates(const StatesAnswer& answer) {
  const auto it = movement_feeds_.find({answer.world, answer.from_shard});
  if (it == movement_feeds_.end() || !it->second.OnStates(answer)) return;
  if (answer.frame != nullptr) {
    SendMovements(answer.world, answer.from_shard, it->second, answer.frame);
  }
  AskForStates();
}

void Session::Fetch(const protocol::FetchLibrary& question) {
  if ((features_ & protocol::kFeatureMovementMode) == 0) {
    host_.metrics().protocol_errors.Add();
    Fail(StatusCode::kUnexpectedMessage, "FetchLibrary needs the feature 'movement mode'");
    return;
  }
  protocol::LibraryPiece piece{.nonce = question.nonce, .hash = question.hash};
  const auto it = std::ranges::find_if(worlds_, [&](const auto& item) {
    return item.second.world->library->hash() == question.hash;
  });
  if (it == worlds_.end()) {
    piece.code = StatusCode::kNotJoined;
    piece.text = "no world this session is in has that library";
    Send(piece);
    return;
  }
  const std::span<const std::byte> file = it->second.world->library->bytes();
  if (question.offset > file.size()) {
    piece.code = StatusCode::kOutOfRange;
    piece.text = "the library ends before that";
    Send(piece);
    return;
  }
  // Beside what a small frame limit leaves for the message itself.
  constexpr std::size_t kOverheadBytes = 512;
  const std::size_t most =
      std::min(protocol::kMaxPieceBytes, host_.config().limits.max_bulk_bytes - kOverheadBytes);
  const std::span<const std::byte> rest = file.subspan(question.offset);
  const std::span<const std::byte> part =
      rest.first(std::min({rest.size(), most, std::size_t{question.length}}));
  piece.total_bytes = file.size();
  piece.offset = question.offset;
  piece.bytes.assign(part.begin(), part.end());
  Send(piece);
}

}  // namespace stridewire::server
