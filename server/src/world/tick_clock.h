#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>

namespace stridewire::server {

/// Tick numbers as the steady clock has them: tick n is due n / tick_hz seconds after the epoch,
/// which all shards share. A value; any thread.
class TickClock {
 public:
  using Clock = std::chrono::steady_clock;

  TickClock(Clock::time_point epoch, double tick_hz) : epoch_(epoch), tick_hz_(tick_hz) {}

  [[nodiscard]] Clock::time_point Due(std::uint64_t tick) const {
    // Whole seconds apart, so that years of ticks lose nothing to rounding.
    const double seconds = static_cast<double>(tick) / tick_hz_;
    const double whole = std::floor(seconds);
    return epoch_ + std::chrono::seconds(static_cast<std::int64_t>(whole)) +
           std::chrono::nanoseconds(static_cast<std::int64_t>(std::ceil((seconds - whole) * 1e9)));
  }

  /// The last tick that is due at `now`.
  [[nodiscard]] std::uint64_t TickAt(Clock::time_point now) const {
    if (now <= epoch_) return 0;
    auto tick = static_cast<std::uint64_t>(ServerTime(now) * tick_hz_);
    while (tick > 0 && Due(tick) > now) --tick;
    while (Due(tick + 1) <= now) ++tick;
    return tick;
  }

  /// Seconds since the epoch: the server's clock on the wire.
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
