#pragma once

#include <cstdint>
#include <random>

namespace stridewire::client {

/// Delays between attempts to connect. The first delay is kFirstS. Each further delay is twice the
/// previous one, up to kLongestS. Each is shortened by a random fraction of up to kJitter, so that
/// the clients of a restarted server do not reconnect all at once (STATE_MACHINE.md, "Timeouts").
class Backoff {
 public:
  static constexpr double kFirstS = 0.1;
  static constexpr double kLongestS = 5.0;
  static constexpr double kJitter = 0.5;

  explicit Backoff(std::uint64_t seed) : random_(seed) {}

  /// Returns the delay in seconds before the next attempt.
  [[nodiscard]] double Next();

  /// Starts again with kFirstS, after a successful attempt.
  void Reset() { max_delay_s_ = kFirstS; }

 private:
  std::mt19937_64 random_;
  double max_delay_s_ = kFirstS;
};

}  // namespace stridewire::client
