#pragma once

#include <utility>
#include <vector>

namespace stridewire {

/// The value below which `percent` of the values lie (linear between ranks); 0 if there are none.
[[nodiscard]] double Percentile(std::vector<double> values, double percent);

[[nodiscard]] inline double Median(std::vector<double> values) {
  return Percentile(std::move(values), 50.0);
}

}  // namespace stridewire
