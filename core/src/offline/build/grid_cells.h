#pragma once

#include <vector>

#include "stridewire/offline/raw_library.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

// Returns the number of cells per keytime interval for a grid with about `fps` cells per second,
// for durations averaged over the examples. `keytimes_s` contains the keytimes of each example.
[[nodiscard]] std::vector<int> CellsAtRate(const std::vector<std::vector<double>>& keytimes_s,
                                           double fps);

// Maximum error of a stored example, averaged over joints and time: 0.45 degrees.
inline constexpr double kStoredErrorRad = 0.45 / 57.29577951308232;

// Chooses the number of grid cells per keytime interval for a group of valid examples. Starts with
// the result of CellsAtRate for `fps`, and adds cells until no example is stored with an error
// above kStoredErrorRad. More cells are needed for slow examples in a group of fast ones, and for
// captures with fast rotations. The number of frames of the longest example and the size of the
// grid limit the number of cells in each interval. Generated steps (RawGroup::is_completed) get no
// additional cells, since they are smooth. `stand_root`: see ResampleOnGrid.
[[nodiscard]] std::vector<int> ChooseCells(const RawGroup& group, double fps,
                                           const GridLayout& layout, const Quat& stand_root);

}  // namespace stridewire
