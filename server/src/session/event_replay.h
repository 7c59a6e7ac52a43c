#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>

#include "base/check.h"
#include "net/shared_frame.h"

namespace stridewire::server {

/// Stores the last Events messages of a session, for a client that has lost its connection. The
/// size is limited; the oldest messages are dropped first.
class EventReplay {
 public:
  explicit EventReplay(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  struct Stored {
    std::uint64_t number = 0;       ///< Number of the message, ascending.
    std::uint64_t event_count = 0;  ///< Number of events in the message.
    /// True if the message was passed to a connection, which may have failed before sending it.
    bool was_sent = false;
    SharedFrame frame;
  };

  void Add(Stored stored) {
    STRIDEWIRE_CHECK(stored.frame != nullptr);
    STRIDEWIRE_CHECK(stored_.empty() || stored_.back().number < stored.number);
    bytes_ += stored.frame->size();
    stored_.push_back(std::move(stored));
    while (bytes_ > max_bytes_) {
      bytes_ -= stored_.front().frame->size();
      if (!stored_.front().was_sent) dropped_events_ += stored_.front().event_count;
      stored_.pop_front();
    }
    STRIDEWIRE_CHECK(!stored_.empty() || bytes_ == 0);
  }

  /// Calls `function(Stored&)` for every message after `last_number`, in order.
  template <typename Function>
  void ForEachAfter(std::uint64_t last_number, Function&& function) {
    for (Stored& stored : stored_) {
      if (stored.number > last_number) function(stored);
    }
  }

  /// Returns how many events were dropped before they were sent, since the previous call.
  [[nodiscard]] std::uint64_t TakeDropped() { return std::exchange(dropped_events_, 0); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  std::size_t max_bytes_;
  std::deque<Stored> stored_;
  std::size_t bytes_ = 0;
  std::uint64_t dropped_events_ = 0;
};

}  // namespace stridewire::server
