#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>

namespace stridewire::server {

/// Converts between tick numbers and the steady clock. Tick n is due n / tick_hz seconds after the
/// epoch, which all shards share. A value type; it can be copied and used by any thread.
class TickClock {
 public:
  using Clock = std::chrono::steady_clock;

  TickClock(Clock::time_point epoch, double tick_hz) : epoch_(epoch), tick_hz_(tick_hz) {}

  [[nodiscard]] Clock::time_point Due(std::uint64_t tick) const {
    // Whole seconds are added separately, so that the rounding error remains small even after
    // years.
    const double seconds = static_cast<double>(tick) / tick_hz_;
    const double whole = std::floor(seconds);
    return epoch_ + std::chrono::seconds(static_cast<std::int64_t>(whole)) +
           std::chrono::nanoseconds(static_cast<std::int64_t>(std::ceil((seconds - whole) * 1e9)));
  }

  /// Returns the last tick that is due at `now`.
  [[nodiscard]] std::uint64_t TickAt(Clock::time_point now) const {
    if (now <= epoch_) return 0;
    auto tick = static_cast<std::uint64_t>(ServerTime(now) * tick_hz_);
    while (tick > 0 && Due(tick) > now) --tick;
    while (Due(tick + 1) <= now) ++tick;
    return tick;
  }

  /// Returns the seconds since the epoch. Clients receive this value as the server's time.
  [[nodiscard]] double ServerTime(Clock::time_point now) const {
    return std::chrono::duration<double>(now - epoch_).count();
  }
  [[nodiscard]] double TickTime(std::uint64_t tick) const {
    return static_cast<double>(tick) / tick_hz_;
  }
  [[nodiscard]] double tick_s() const { return 1.0 / tick_hz_; }
  [[nodiscard]] double tick_hz() const { return tick_hz_; }

 private:
  Clock::time_point epoch_;
  double tick_hz_;
};

}  // namespace stridewire::server
