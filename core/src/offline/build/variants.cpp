#include "offline/build/variants.h"

#include <algorithm>

#include "base/check.h"
#include "offline/base/statistics.h"
#include "runtime/library/keytimes.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/variant_choice.h"

namespace stridewire {

std::vector<GridExample> ChooseVariants(const std::vector<GridExample>& found,
                                        std::span<const SelectedExample> used,
                                        std::span<const double> units, bool is_smooth) {
  STRIDEWIRE_CHECK(used.size() == found.size());
  if (units.size() > kMaxVariedParameters) return {};
  std::vector<double> medians;
  for (std::size_t l = 0; l < units.size(); ++l) {
    std::vector<double> values;
    for (const GridExample& step : found) values.push_back(step.parameters[l]);
    medians.push_back(Median(std::move(values)));
  }
  std::vector<std::pair<double, std::size_t>> steps;  // Squared distance to the medians, and index.
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (used[i].fate == ExampleFate::kOutlier) continue;
    if (used[i].fate == ExampleFate::kKept && !is_smooth) continue;
    double squares = 0.0;
    for (std::size_t l = 0; l < units.size(); ++l) {
      const double difference = units[l] * (found[i].parameters[l] - medians[l]);
      squares += difference * difference;
    }
    steps.emplace_back(squares, i);
  }
  std::sort(steps.begin(), steps.end());
  steps.resize(std::min(steps.size(), kStoredVariants));
  std::vector<GridExample> variants;
  for (const auto& [squares, i] : steps) variants.push_back(found[i]);
  return variants;
}

void AdaptToBlend(const MotionGroup& group, const GridLayout& layout, GridExample& variant) {
  std::vector<double> scratch(static_cast<std::size_t>(group.example_count));
  Movement movement;
  SetWeights(group, -1, variant.parameters, scratch, movement);
  BlendKeytimes(group.keytimes_s, movement.weights, variant.keytimes_s);
  variant.heading_change_rad = movement.heading_change_rad;

  const auto last = static_cast<std::size_t>(group.grid_point_count) - 1;
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  GridCache cache(layout);
  const auto blended = cache.Row(group, movement.weights, static_cast<int>(last));
  const double aside_m = layout.RootOf(blended.data()).position_m.x -
                         layout.RootOf(&variant.rows[last * row_floats]).position_m.x;
  for (std::size_t p = 0; p <= last; ++p) {
    float* row = &variant.rows[p * row_floats];
    GridLayout::Root root = layout.RootOf(row);
    root.position_m.x += aside_m * static_cast<double>(p) / static_cast<double>(last);
    layout.SetRoot(row, root);
  }
}

}  // namespace stridewire
