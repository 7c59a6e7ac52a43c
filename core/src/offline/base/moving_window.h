#pragma once

#include <vector>

namespace stridewire {

/// Returns the maximum of each value and of the `half` values before and after it.
[[nodiscard]] std::vector<double> MovingMaximum(const std::vector<double>& values, int half);

/// Returns the weighted mean of each value and of the values around it. `weights` has an odd size,
/// and its middle belongs to the value itself. The first and the last value continue beyond the
/// ends.
[[nodiscard]] std::vector<double> MovingMean(const std::vector<double>& values,
                                             const std::vector<double>& weights);

}  // namespace stridewire
