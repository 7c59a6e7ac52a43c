#pragma once

#include <optional>
#include <vector>

namespace stridewire::builtin {

/// A C1 curve through knots: cubic Hermite pieces. A knot without a slope gets the one that keeps
/// the curve monotone between knots (PCHIP, Fritsch and Carlson 1980). Constant beyond its ends.
class Curve {
 public:
  struct Knot {
    double time_s = 0.0;
    double value = 0.0;
    std::optional<double> slope = std::nullopt;
  };

  Curve() : Curve({{0.0, 0.0}}) {}

  /// `knots` in order of time, at least one; a knot less than 1e-9 s after its forerunner is left out.
  explicit Curve(const std::vector<Knot>& knots);

  [[nodiscard]] double At(double time_s) const;

 private:
  std::vector<double> times_s_;
  std::vector<double> values_;
  std::vector<double> slopes_;
};

}  // namespace stridewire::builtin
