#pragma once

#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

// Clusters examples by complete linkage: it repeatedly merges the two clusters whose most distant
// members are nearest. Within a cluster all parameters, multiplied by `units`, lie within
// `diameter` of each other. Clusters and their members are sorted by index.
[[nodiscard]] std::vector<std::vector<int>> CompleteLinkage(
    const std::vector<GridExample>& examples, std::span<const double> units, double diameter);

// Averages examples at equal generic times, including their keytimes. The examples must have
// aligned hemispheres. The parameters of steps are measured again on the result; those of jumps are
// averaged.
[[nodiscard]] GridExample AverageExamples(const std::vector<GridExample>& examples,
                                          std::span<const int> members, const GridLayout& layout,
                                          const Skeleton& skeleton, const RawGroup& group);

}  // namespace stridewire
