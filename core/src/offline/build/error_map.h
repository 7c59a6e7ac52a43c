#pragma once

#include <memory>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Selects the slice of the parameter space of a group that a map covers. One or two parameters
/// vary, given by index; the others are constant, see ErrorMap::others.
struct ErrorMapOptions {
  int axis_x = 0;
  int axis_y = -1;   ///< Index of the parameter on the second axis; -1: only one parameter varies.
  int columns = 41;  ///< 2 to kMaxPoints.
  int rows = 41;     ///< Number of rows, 2 to kMaxPoints. If axis_y is -1, there is one row.
  static constexpr int kMaxPoints = 1000;
};

/// The error e(p) = |p - a(p)| on a grid over a slice of the parameter space of a group (paper,
/// Figure 1). The grid spans the range of the examples. Values outside their hull are NaN.
struct ErrorMap {
  /// Values of the parameters on the two axes, by column and by row.
  std::vector<double> x, y;
  std::vector<double> others;      ///< Values of the constant parameters, by parameter.
  std::vector<double> error_m;     ///< [row][column]: error without weight correction.
  std::vector<double> weight_sum;  ///< [row][column]: sum of |w|.
  double max_error_m = 0.0;        ///< Largest error on the map; the group may have larger ones.
};

/// Measures an error map. Each parameter without an axis has its mean value over the examples. Uses
/// all processors; the result does not depend on their number. Error: kOutOfRange for an option or
/// the group.
[[nodiscard]] Expected<ErrorMap> MeasureErrorMap(const MotionLibrary& library, int group_index,
                                                 const ErrorMapOptions& options = {});

}  // namespace stridewire
