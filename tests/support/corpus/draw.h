#pragma once

#include <algorithm>
#include <cstddef>

#include "offline/base/text.h"
#include "random.h"

namespace stridewire::test {

inline bool Chance(Random& random, double probability) {
  return random.Draw(0.0, 1.0) < probability;
}

/// Draws a whole number from 0 to `count` - 1.
inline int Below(Random& random, std::size_t count) {
  const auto drawn = static_cast<int>(random.Draw(0.0, static_cast<double>(count)));
  return std::min(drawn, static_cast<int>(count) - 1);
}

}  // namespace stridewire::test
