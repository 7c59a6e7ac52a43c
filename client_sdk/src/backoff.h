#pragma once

#include <cstdint>
#include <random>

namespace stridewire::client {

/// How long to wait before the next attempt: kFirst_s, doubled with every attempt up to kLongest_s,
/// each shortened at random by up to kJitter of itself, so that the clients of a server that went
/// away do not all come back in the same instant (STATE_MACHINE.md, "Timeouts").
class Backoff {
 public:
  static constexpr double kFirst_s = 0.1;
  static constexpr double kLongest_s = 5.0;
  static constexpr double kJitter = 0.5;

  explicit Backoff(std::uint64_t seed) : random_(seed) {}

  /// Wait before the next attempt, in [(1 - kJitter) d, d].
  [[nodiscard]] double Next();

  /// An attempt has succeeded.
  void Reset() { longest_wait_s_ = kFirst_s; }

 private:
  std::mt19937_64 random_;
  double longest_wait_s_ = kFirst_s;
};

}  // namespace stridewire::client
