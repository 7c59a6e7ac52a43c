#pragma once

#include <utility>
#include <vector>

namespace stridewire {

/// Returns a percentile with linear interpolation between ranks; 0 if `values` is empty.
[[nodiscard]] double Percentile(std::vector<double> values, double percent);

[[nodiscard]] inline double Median(std::vector<double> values) {
  return Percentile(std::move(values), 50.0);
}

}  // namespace stridewire
