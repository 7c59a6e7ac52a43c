#pragma once

#include <optional>
#include <vector>

namespace stridewire::builtin {

/// A C1 curve of cubic Hermite segments through knots. It is constant beyond its ends. An inner
/// knot without a slope gets the slope that keeps the curve monotone between knots (PCHIP, Fritsch
/// and Carlson 1980). The first and the last knot get slope 0 by default.
class Curve {
 public:
  struct Knot {
    double time_s = 0.0;
    double value = 0.0;
    std::optional<double> slope = std::nullopt;
  };

  Curve() : Curve({{0.0, 0.0}}) {}

  /// `knots` must be non-empty and sorted by time. Knots less than 1e-9 s after their predecessor
  /// are ignored.
  explicit Curve(const std::vector<Knot>& knots);

  [[nodiscard]] double At(double time_s) const;

 private:
  std::vector<double> times_s_;
  std::vector<double> values_;
  std::vector<double> slopes_;
};

}  // namespace stridewire::builtin
