#pragma once

#include <random>

namespace stridewire {

/// Numbers that are the same with any standard library, whose distributions differ.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double Draw(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_()) / 4294967296.0;
  }

 private:
  std::mt19937 engine_;
};

}  // namespace stridewire
