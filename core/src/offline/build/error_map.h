#pragma once

#include <memory>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Which part of a group's parameter space a map shows: one or two of its parameters, by index; the
/// others are held at `others`.
struct ErrorMapOptions {
  int axis_x = 0;
  int axis_y = -1;   ///< -1: only one
  int columns = 41;  ///< 2 to kMostPoints
  int rows = 41;     ///< likewise; 1 is used where axis_y is -1
  static constexpr int kMostPoints = 1000;
};

/// e(p) = |p - a(p)| on a grid over a slice of a group's parameter space (paper, Figure 1): from the
/// least to the largest value an example has, NaN outside the hull of the examples.
struct ErrorMap {
  std::vector<double> x, y;        ///< [column], [row]: values of the parameters
  std::vector<double> others;      ///< [parameter]: what the parameters not shown are held at
  std::vector<double> error_m;     ///< [row][column]: as movements start uncorrected
  std::vector<double> weight_sum;  ///< [row][column]: of |w|
  double max_error_m = 0.0;        ///< Of those shown, not of the group
};

/// The parameters not shown are held at their mean over the examples. Uses all processors, same result
/// with any number of them. kOutOfRange: an option, the group.
[[nodiscard]] Expected<ErrorMap> MeasureErrorMap(const MotionLibrary& library, int group_index,
                                                 const ErrorMapOptions& options = {});

}  // namespace stridewire
