#include "offline/builtin/curve.h"

#include <cstddef>

#include "base/check.h"

namespace stridewire::builtin {

Curve::Curve(const std::vector<Knot>& knots) {
  STRIDEWIRE_CHECK(!knots.empty());
  std::vector<std::optional<double>> given;
  for (const Knot& knot : knots) {
    if (!times_s_.empty() && knot.time_s < times_s_.back() + 1e-9) continue;
    times_s_.push_back(knot.time_s);
    values_.push_back(knot.value);
    given.push_back(knot.slope);
  }
  const std::size_t count = times_s_.size();
  const auto chord = [&](std::size_t i) {
    return (values_[i + 1] - values_[i]) / (times_s_[i + 1] - times_s_[i]);
  };
  slopes_.assign(count, 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    if (given[i]) {
      slopes_[i] = *given[i];
    } else if (i > 0 && i + 1 < count) {
      const double before = chord(i - 1), after = chord(i);
      if (before * after <= 0.0) continue;
      const double h0 = times_s_[i] - times_s_[i - 1], h1 = times_s_[i + 1] - times_s_[i];
      const double w0 = 2.0 * h1 + h0, w1 = h1 + 2.0 * h0;
      slopes_[i] = (w0 + w1) / (w0 / before + w1 / after);
    }
  }
}

double Curve::At(double time_s) const {
  if (time_s <= times_s_.front()) return values_.front();
  if (time_s >= times_s_.back()) return values_.back();
  std::size_t i = 0;
  while (time_s >= times_s_[i + 1]) ++i;
  const double h = times_s_[i + 1] - times_s_[i];
  const double s = (time_s - times_s_[i]) / h;
  const double s2 = s * s, s3 = s2 * s;
  return (2.0 * s3 - 3.0 * s2 + 1.0) * values_[i] + (s3 - 2.0 * s2 + s) * h * slopes_[i] +
         (3.0 * s2 - 2.0 * s3) * values_[i + 1] + (s3 - s2) * h * slopes_[i + 1];
}

}  // namespace stridewire::builtin
