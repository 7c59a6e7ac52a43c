#include "backoff.h"

#include <algorithm>

#include "base/check.h"

namespace stridewire::client {

double Backoff::Next() {
  STRIDEWIRE_CHECK(max_delay_s_ >= kFirstS && max_delay_s_ <= kLongestS);
  const double delay_s = max_delay_s_;
  max_delay_s_ = std::min(2.0 * max_delay_s_, kLongestS);
  return delay_s * (1.0 - kJitter * std::uniform_real_distribution<double>(0.0, 1.0)(random_));
}

}  // namespace stridewire::client
