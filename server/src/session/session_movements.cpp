// The part of a session that tells what avatars begin, and gives out their library, to a client that evaluates the poses itself.

#include <algorithm>

#include "session/session.h"

namespace stridewire::server {

using protocol::StatusCode;

namespace {

// States are asked for this much at a time, of each shard.
constexpr std::size_t kStatesBytes = 100'000;

}  // namespace

// The client knows nothing of the avatars of a world, or not of all it is now to show.
void Session::BeginMovements(const std::shared_ptr<World>& world) {
  for (int shard = 0; shard < host_.shard_count(); ++shard) {
    MovementFeed& feed = movement_feeds_[{world->id, shard}];
    feed = {.world = world, .is_lost = feed.is_lost};
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
    if (feed.is_lost && waiting == 0) {
      feed.is_lost = false;
      feed.next = 1;
      feed.asked = 0;
    }
    if (feed.is_lost || feed.next == 0 || feed.asked != 0 || waiting > little) continue;
    if (++states_nonce_ == 0) ++states_nonce_;
    feed.asked = states_nonce_;
    host_.Ask(key.second, StatesQuestion{.world = feed.world,
                                         .from_shard = host_.shard_index(),
                                         .session = identity_.id,
                                         .nonce = feed.asked,
                                         .first = feed.next,
                                         .enough_bytes = std::min(kStatesBytes, little)});
  }
}

void Session::OnSent() {
  UpdatePause();
  AskForStates();
}

void Session::SendMovements(WorldId world, int shard, const SharedFrame& frame) {
  const auto feed = movement_feeds_.find({world, shard});
  if (connection_ == nullptr || feed == movement_feeds_.end() || feed->second.is_lost) return;
  const std::size_t dropped = connection_->SendMovements(world, shard, frame);
  if (dropped == 0) return;
  feed->second.is_lost = true;
  worlds_.at(world).dropped_batches += dropped;
  host_.metrics().batches_dropped.Add(dropped);
  host_.metrics().Reached(Limit::kObserverBacklog);
}

void Session::OnMovements(const MovementDelivery& delivery) {
  for (const SharedFrame& frame : delivery.frames) {
    SendMovements(delivery.world, delivery.from_shard, frame);
  }
  // Nothing waits to be sent any more, so OnSent did not come: a feed that was lost goes on from here.
  AskForStates();
}

void Session::OnStates(const StatesAnswer& answer) {
  const auto it = movement_feeds_.find({answer.world, answer.from_shard});
  if (it == movement_feeds_.end() || it->second.asked != answer.nonce) return;
  MovementFeed& feed = it->second;
  feed.asked = 0;
  feed.next = answer.next;
  if (answer.frame != nullptr) SendMovements(answer.world, answer.from_shard, answer.frame);
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
