#pragma once

#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

// Groups examples so that within each all parameters, times `units`, lie within `diameter` of each
// other (complete linkage: the two clusters whose furthest members are nearest are joined first).
// Clusters and their members in ascending order of index.
[[nodiscard]] std::vector<std::vector<int>> CompleteLinkage(
    const std::vector<GridExample>& examples, std::span<const double> units, double diameter);

// Mean of some hemisphere-aligned examples at equal generic times, keytimes too. The parameters of
// a step are measured again on the result; a jump's are averaged.
[[nodiscard]] GridExample AverageExamples(const std::vector<GridExample>& examples,
                                          std::span<const int> members, const GridLayout& layout,
                                          const Skeleton& skeleton, const RawGroup& group);

}  // namespace stridewire
