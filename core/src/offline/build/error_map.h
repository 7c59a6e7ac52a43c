#pragma once

#include <memory>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Selects a slice of the parameter space of a group. One or two parameters vary and are given by
/// index. The others are constant (ErrorMap::others).
struct ErrorMapOptions {
  int axis_x = 0;
  int axis_y = -1;   ///< Index of the parameter on the second axis; -1: only one parameter varies.
  int columns = 41;  ///< 2 to kMaxPoints.
  int rows = 41;     ///< Number of rows, 2 to kMaxPoints. If axis_y is -1, there is one row.
  static constexpr int kMaxPoints = 1000;
};

/// The error e(p) = |p - a(p)| on a grid over a slice of the parameter space of a group (paper,
/// Figure 1). a(p) are the measured parameters of the movement synthesized for p. The grid covers
/// the range of the examples. Values outside their hull are NaN.
struct ErrorMap {
  /// Values of the parameters on the axes, by column and by row. If axis_y is -1, `y` contains only
  /// 0.
  std::vector<double> x, y;
  /// [parameter]: values of the constant parameters. Those of varying parameters are not used.
  std::vector<double> others;
  std::vector<double> error_m;     ///< [row][column]: error without weight correction.
  std::vector<double> weight_sum;  ///< [row][column]: sum of |w|.
  /// Largest error on the map. The group may have larger errors elsewhere.
  double max_error_m = 0.0;
};

/// Measures an error map. Each parameter without an axis has its mean value over the examples. Uses
/// all processors; the result does not depend on their number. Fails with kOutOfRange if an option
/// is out of range or the group does not exist.
[[nodiscard]] Expected<ErrorMap> MeasureErrorMap(const MotionLibrary& library, int group_index,
                                                 const ErrorMapOptions& options = {});

}  // namespace stridewire
