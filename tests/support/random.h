#pragma once

#include <random>

namespace stridewire {

/// Random numbers that are the same with every standard library. The distributions of standard
/// libraries differ.
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
