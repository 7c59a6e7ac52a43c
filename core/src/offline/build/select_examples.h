#pragma once

#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

// The examples of a group to be stored, and why.
struct Selected {
  std::vector<std::vector<int>> clusters;  // Examples to be stored as one; sorted by index.
  std::vector<GridExample> examples;       // [cluster]
  GroupSelection report;                   // Everything except `group`.
};

// Selects the examples of a group to be stored:
//
//   1. Outliers are dropped.
//   2. Examples within `diameter` of each other are averaged.
//   3. Starting with one average, the average that the chosen ones reproduce worst is added, until
//      all are within the bound.
//   4. In the order of adding, averages that the others reproduce within the bound are removed.
//
// The result does not depend on the number of threads.
struct SelectExamplesJob {
  const std::vector<GridExample>& examples;  // Examples with aligned hemispheres.
  std::span<const double> units;             // Metres per unit of each parameter.
  double diameter = 0.0;                     // Metres.
  const SelectionOptions& options;
  const GridLayout& layout;
  const Skeleton& skeleton;
  const RawGroup& group;

  [[nodiscard]] Selected Run() const;
};

}  // namespace stridewire
