#pragma once

#include <vector>

#include "stridewire/offline/raw_library.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

// What a stored example may differ from its clip, radians: mean over joints and time.
inline constexpr double kStoredErrorRad = 0.45 / 57.29577951308232;

// Grid cells of each keytime interval of a group of valid examples: about `fps` a second of the mean
// interval, and more where an example would otherwise be stored worse than kStoredErrorRad. Slow
// examples in a group of quick ones and restless captures need it: at 30 cells a second steps of
// subject 01 come out 0.6 degrees off in the mean and up to 1.2. Never more cells than the longest
// example has frames (or the grid has room for).
[[nodiscard]] std::vector<int> ChooseCells(const RawGroup& group, double fps,
                                           const GridLayout& layout);

}  // namespace stridewire
