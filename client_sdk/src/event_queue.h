#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>

#include "stridewire/client.h"

namespace stridewire::client {

/// Events that the application has not polled yet. A full queue drops its oldest event. The next
/// event that is taken contains the number of dropped events.
class EventQueue {
 public:
  /// Creates an empty queue. `capacity` must be above 0.
  explicit EventQueue(std::size_t capacity) : capacity_(capacity) {}

  void Push(const stridewire_event& event);

  /// Moves the oldest events to `out` and returns their number.
  std::size_t Take(std::span<stridewire_event> out);

  [[nodiscard]] bool empty() const { return events_.empty(); }
  [[nodiscard]] std::size_t size() const { return events_.size(); }
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }

 private:
  std::size_t capacity_;
  std::deque<stridewire_event> events_;
  std::uint64_t dropped_ = 0;
  std::uint64_t dropped_since_take_ = 0;
};

}  // namespace stridewire::client
