#pragma once

#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

// The examples of a group to store, and why they were selected.
struct Selected {
  // [stored example]: indices of the examples of which it is the average, in ascending order.
  // Clusters are sorted by their first index.
  std::vector<std::vector<int>> clusters;
  std::vector<GridExample> examples;  // [cluster]
  GroupSelection report;  // Report of the selection. All members except `group` are set.
};

// Selects the examples of a group to store:
//
// 1. Drops outliers, if SelectionOptions::outlier_deviations is above 0.
// 2. Averages examples within `diameter` of each other.
// 3. If SelectionOptions::max_pose_error_m is above 0, chooses few of the averages. Starts with one
//    and adds the average that the chosen ones reproduce worst, until all are reproduced within the
//    error bound. Finally, removes chosen averages without which the bound is still met.
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
