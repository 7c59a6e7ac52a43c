#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>

#include "stridewire/client.h"

namespace stridewire::client {

/// Events waiting to be polled, at most `capacity`: a full queue drops its oldest event, counts it
/// and tells so in the next one that is taken.
class EventQueue {
 public:
  explicit EventQueue(std::size_t capacity) : capacity_(capacity) {}

  void Push(const stridewire_event& event);

  /// Takes the oldest ones; returns how many were written.
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
