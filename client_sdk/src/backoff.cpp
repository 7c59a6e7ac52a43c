#include "backoff.h"

#include <algorithm>

namespace stridewire::client {

double Backoff::Next() {
  const double wait_s = longest_wait_s_;
  longest_wait_s_ = std::min(2.0 * longest_wait_s_, kLongest_s);
  return wait_s * (1.0 - kJitter * std::uniform_real_distribution<double>(0.0, 1.0)(random_));
}

}  // namespace stridewire::client
