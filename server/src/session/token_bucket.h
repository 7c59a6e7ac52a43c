#pragma once

#include <algorithm>

namespace stridewire::server {

/// Rate limiter: allows `rate_per_s` tokens per second on average and `burst` tokens at once. Time
/// is an argument, in seconds.
class TokenBucket {
 public:
  TokenBucket(double rate_per_s, double burst)
      : rate_per_s_(rate_per_s), burst_(burst), tokens_(burst) {}

  void AdvanceTime(double now_s) {
    if (now_s > last_s_) tokens_ = std::min(burst_, tokens_ + (now_s - last_s_) * rate_per_s_);
    last_s_ = std::max(last_s_, now_s);
  }

  /// Takes `count` tokens. If fewer are available, takes none and returns false.
  [[nodiscard]] bool Take(double count) {
    if (tokens_ < count) return false;
    tokens_ -= count;
    return true;
  }
  [[nodiscard]] double tokens() const { return tokens_; }

 private:
  double rate_per_s_;
  double burst_;
  double tokens_;
  double last_s_ = 0.0;
};

}  // namespace stridewire::server
