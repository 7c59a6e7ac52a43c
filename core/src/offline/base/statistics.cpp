#include "offline/base/statistics.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace stridewire {

double Percentile(std::vector<double> values, double percent) {
  STRIDEWIRE_CHECK(percent >= 0.0 && percent <= 100.0);
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  const double rank = percent / 100.0 * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(rank);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (rank - static_cast<double>(below)) * (values[above] - values[below]);
}

}  // namespace stridewire
