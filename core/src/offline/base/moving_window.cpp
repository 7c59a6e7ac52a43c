#include "offline/base/moving_window.h"

#include <algorithm>
#include <cstddef>

namespace stridewire {

std::vector<double> MovingMaximum(const std::vector<double>& values, int half) {
  const int count = static_cast<int>(values.size());
  std::vector<double> maxima;
  maxima.reserve(values.size());
  for (int i = 0; i < count; ++i) {
    const auto first = values.begin() + std::max(0, i - half);
    const auto end = values.begin() + std::min(count, i + half + 1);
    maxima.push_back(*std::max_element(first, end));
  }
  return maxima;
}

std::vector<double> MovingMean(const std::vector<double>& values,
                               const std::vector<double>& weights) {
  const int count = static_cast<int>(values.size());
  const int half = static_cast<int>(weights.size() / 2);
  std::vector<double> means;
  means.reserve(values.size());
  for (int i = 0; i < count; ++i) {
    double sum = 0.0;
    double weight_sum = 0.0;
    for (int k = -half; k <= half; ++k) {
      const double weight = weights[static_cast<std::size_t>(k + half)];
      sum += weight * values[static_cast<std::size_t>(std::clamp(i + k, 0, count - 1))];
      weight_sum += weight;
    }
    means.push_back(sum / weight_sum);
  }
  return means;
}

}  // namespace stridewire
