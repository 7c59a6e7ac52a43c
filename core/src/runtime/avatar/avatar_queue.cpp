// AvatarSimulation: the queue of requests, and requests that are dropped from it.

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "runtime/avatar/avatar_simulation.h"

namespace stridewire {
namespace {

// If an empty queue has memory for more requests than this, the next Enqueue releases it.
constexpr std::size_t kUsualQueue = 8;

}  // namespace

const char* DropReason(RequestOutcome outcome) {
  switch (outcome) {
    case RequestOutcome::kCancelled: return "the request was cancelled";
    case RequestOutcome::kReplaced: return "another request replaced this one";
    case RequestOutcome::kRemoved: return "the avatar was removed";
    case RequestOutcome::kNone:
    case RequestOutcome::kCompleted:
    case RequestOutcome::kRejected: break;
  }
  return "";
}

Status AvatarSimulation::Enqueue(const MovementRequest& request, double start_delay_s) {
  STRIDEWIRE_CHECK(start_delay_s >= 0.0);
  if (Status status = ValidateRequest(*body_.library, request); !status) return status;
  if (queue_size() >= kMaxQueue) {
    return Fail(ErrorCode::kLimitExceeded, "the avatar's queue is full", kMaxQueue);
  }
  if (const auto* step = std::get_if<StepRequest>(&request.movement); step && step->exact_only) {
    if (!foot_planting()) return Fail(ErrorCode::kUnsupported, kNeedsPlanting);
    if (saved_.empty()) {
      saved_.resize(1);
      saved_.front().pose = Pose(body_.library->skeleton().joint_count());
      Reserve(*body_.library, saved_.front().movement);
      // A single tick may reject many requests, so memory for all its events is reserved here.
      events_.reserve(kMaxEventsPerAdvance);
    }
  }
  const double earlier_start_s = start_not_before_s_;
  if (request.interrupt != Interrupt::kNone) {
    DropQueue(RequestOutcome::kReplaced);
    next_event_s_ = -1.0;
    interrupts_ = may_redirect_ = request.interrupt == Interrupt::kNow && is_moving_;
    if (is_in_stand_) {
      is_stand_cut_short_ = is_stand_cut_short_ || stand_left_s_ > 0.0;
      stand_left_s_ = 0.0;
    }
  }
  if (!is_moving_) next_event_s_ = -1.0;
  if (queue_size() == 0) {
    start_not_before_s_ = time_s_ + start_delay_s;
    if (earlier_start_s > time_s_)
      start_not_before_s_ = std::min(start_not_before_s_, earlier_start_s);
  }
  if (queue_head_ >= 4 && queue_head_ * 2 > queue_.size()) {
    queue_.erase(queue_.begin(), queue_.begin() + static_cast<std::ptrdiff_t>(queue_head_));
    queue_head_ = 0;
  }
  // The queue grows in small steps, and a queue that was long and has become empty releases its
  // memory here. In a crowd, many queues tend to be long at the same time, but only briefly.
  if (queue_.empty() && queue_.capacity() > kUsualQueue) queue_.shrink_to_fit();
  if (queue_.size() == queue_.capacity()) {
    queue_.reserve(queue_.size() + std::max<std::size_t>(2, queue_.size() / 4));
  }
  queue_.push_back(request);
  STRIDEWIRE_CHECK(queue_size() >= 1 && queue_size() <= kMaxQueue);
  STRIDEWIRE_CHECK(start_not_before_s_ >= 0.0);
  return {};
}

int AvatarSimulation::CancelQueue() {
  const int dropped = queue_size();
  DropQueue(RequestOutcome::kCancelled);
  return dropped;
}

void AvatarSimulation::DropQueue(RequestOutcome outcome) {
  std::span<const MovementRequest> requests = queue();
  // The next Advance reports the dropped requests, so it is not event-free.
  if (!requests.empty()) next_event_s_ = -1.0;
  if (IsWalkInProgress()) {
    STRIDEWIRE_CHECK(!requests.empty() && requests.front().id == request_id_);
    walk_outcome_ = outcome;
    requests = requests.subspan(1);
  }
  for (const MovementRequest& request : requests) dropped_.push_back({request.id, outcome});
  ClearQueue();
}

void AvatarSimulation::DropAll(RequestOutcome outcome) {
  const bool was_dropped = walk_outcome_ != RequestOutcome::kNone;
  if ((is_moving_ || is_in_stand_) && request_id_ != 0) {
    dropped_.push_back({request_id_, was_dropped ? walk_outcome_ : outcome});
  }
  if (IsWalkInProgress()) ++queue_head_;
  is_walk_step_ = false;
  walk_outcome_ = RequestOutcome::kNone;
  DropQueue(outcome);
}

void AvatarSimulation::ClearQueue() {
  queue_.clear();
  queue_head_ = 0;
  walk_ = {};
  walk_pace_ = {};
  interrupts_ = may_redirect_ = false;
  start_not_before_s_ = 0.0;
}

// Removes the request at the head of the queue and returns its id.
std::uint64_t AvatarSimulation::PopQueue() {
  STRIDEWIRE_CHECK(queue_head_ < queue_.size());
  const std::uint64_t id = queue_[queue_head_++].id;
  if (queue_size() == 0) ClearQueue();
  return id;
}

// Adds an event for each request that was dropped before this Advance.
void AvatarSimulation::AddDroppedEvents() {
  max_events_ = kMaxEventsPerAdvance + dropped_.size();
  // Releases the memory that an earlier Advance with many dropped requests allocated.
  if (dropped_.empty() && events_.capacity() > kMaxEventsPerAdvance) {
    events_.shrink_to_fit();
    events_.reserve(kMaxEventsPerAdvance);
  }
  for (const DroppedRequest& dropped : std::exchange(dropped_, {})) {
    AddEvent({.type = AvatarEventType::kDropped,
              .request_id = dropped.id,
              .base = base_,
              .reason = DropReason(dropped.outcome),
              .outcome = dropped.outcome});
  }
}

// If the current walk was dropped while its last step was in progress, reports that it has ended.
// Call it when that step has ended.
void AvatarSimulation::EndDroppedWalk() {
  if (walk_outcome_ == RequestOutcome::kNone) return;
  AddEvent({.type = AvatarEventType::kDropped,
            .request_id = request_id_,
            .base = base_,
            .reason = DropReason(walk_outcome_),
            .outcome = std::exchange(walk_outcome_, RequestOutcome::kNone)});
}

}  // namespace stridewire
