#pragma once

#include <vector>

namespace stridewire {

/// Returns, for each value, the maximum of this value and of the `half` values before and after it.
[[nodiscard]] std::vector<double> MovingMaximum(const std::vector<double>& values, int half);

/// Returns, for each value, the weighted mean of it and its neighbours. `weights` has an odd size,
/// and its middle element is the weight of the value itself. Beyond both ends, the first and the
/// last value are repeated.
[[nodiscard]] std::vector<double> MovingMean(const std::vector<double>& values,
                                             const std::vector<double>& weights);

}  // namespace stridewire
