#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>

#include "net/shared_frame.h"

namespace stridewire::server {

/// The last Events of a session, kept for a client that lost its connection. Bounded in bytes: the
/// oldest go first.
class EventReplay {
 public:
  explicit EventReplay(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  struct Kept {
    std::uint64_t number = 0;
    std::uint64_t events = 0;  ///< How many are in it.
    bool was_sent = false;     ///< Handed to a connection; it may be lost all the same.
    SharedFrame frame;
  };

  void Keep(Kept kept) {
    bytes_ += kept.frame->size();
    kept_.push_back(std::move(kept));
    while (bytes_ > max_bytes_) {
      bytes_ -= kept_.front().frame->size();
      if (!kept_.front().was_sent) forgotten_events_ += kept_.front().events;
      kept_.pop_front();
    }
  }

  /// Calls with a Kept&, in order, for everything after `last_number`.
  template <typename Function>
  void ForEachAfter(std::uint64_t last_number, Function&& function) {
    for (Kept& kept : kept_) {
      if (kept.number > last_number) function(kept);
    }
  }

  /// Events that were forgotten before they were sent, since this was last called.
  [[nodiscard]] std::uint64_t TakeForgotten() { return std::exchange(forgotten_events_, 0); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  std::size_t max_bytes_;
  std::deque<Kept> kept_;
  std::size_t bytes_ = 0;
  std::uint64_t forgotten_events_ = 0;
};

}  // namespace stridewire::server
