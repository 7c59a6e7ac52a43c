#pragma once

#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

// What is to be stored of a group, and why.
struct Selected {
  std::vector<std::vector<int>> clusters;  // of examples to store as one, ascending
  std::vector<GridExample> examples;       // [cluster]
  GroupSelection report;                   // all but `group`
};

// Chooses from the hemisphere-aligned examples of a group: outliers go, those within `diameter` of each
// other are averaged, then as few of these as make all others within the bound: the worst made is added
// until none is worse (forward), then whichever can be spared is (backward, in the order they came). The same
// result with any number of threads.
[[nodiscard]] Selected SelectExamples(const std::vector<GridExample>& examples,
                                      std::span<const double> units, double diameter,
                                      const SelectionOptions& options, const GridLayout& layout,
                                      const Skeleton& skeleton, const RawGroup& group);

}  // namespace stridewire
