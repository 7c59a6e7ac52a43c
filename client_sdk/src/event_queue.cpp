#include "event_queue.h"

#include "base/check.h"

namespace stridewire::client {

void EventQueue::Push(const stridewire_event& event) {
  STRIDEWIRE_CHECK(capacity_ > 0 && events_.size() <= capacity_);
  if (events_.size() == capacity_) {
    events_.pop_front();
    ++dropped_;
    ++dropped_since_take_;
  }
  events_.push_back(event);
}

std::size_t EventQueue::Take(std::span<stridewire_event> out) {
  std::size_t count = 0;
  while (count < out.size() && !events_.empty()) {
    out[count] = events_.front();
    out[count].events_dropped_before = dropped_since_take_;
    dropped_since_take_ = 0;
    events_.pop_front();
    ++count;
  }
  return count;
}

}  // namespace stridewire::client
