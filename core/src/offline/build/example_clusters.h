#pragma once

#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

// Clusters examples by complete linkage: repeatedly merges the two clusters whose most distant
// members are closest to each other. Within a cluster, the distance between any two examples is
// less than `diameter`. It is the Euclidean distance of their parameters, multiplied by `units`
// [parameter]. Clusters and their members are sorted by index.
[[nodiscard]] std::vector<std::vector<int>> CompleteLinkage(
    const std::vector<GridExample>& examples, std::span<const double> units, double diameter);

// Averages the poses of examples at equal generic times, and their keytimes. The examples must have
// aligned hemispheres (AlignHemispheres). The parameters of steps are measured again on the result.
// Those of jumps are averaged.
[[nodiscard]] GridExample AverageExamples(const std::vector<GridExample>& examples,
                                          std::span<const int> members, const GridLayout& layout,
                                          const Skeleton& skeleton, const RawGroup& group);

}  // namespace stridewire
