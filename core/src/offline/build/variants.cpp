#include "offline/build/variants.h"

#include <algorithm>
#include <functional>

#include "base/check.h"
#include "offline/base/statistics.h"
#include "runtime/library/keytimes.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/skeleton/foot_vector.h"
#include "runtime/weights/variant_choice.h"

namespace stridewire {

std::vector<std::size_t> ChooseVariants(const std::vector<GridExample>& found,
                                        std::span<const SelectedExample> used,
                                        std::span<const double> units, bool is_smooth) {
  STRIDEWIRE_CHECK(used.size() == found.size());
  if (units.size() > kMaxVariantParameters) return {};
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
  std::vector<std::size_t> variants;
  for (const auto& [squares, i] : steps) variants.push_back(i);
  return variants;
}

namespace {

// Sets the weights of a movement to those of the group's blend for these parameters.
void BlendFor(std::span<const double> parameters, const MotionGroup& group, Movement& movement) {
  std::vector<double> scratch(static_cast<std::size_t>(group.example_count));
  SetWeights(group, -1, parameters, scratch, movement);
}

// Returns how far the root is ahead of the ball of a foot in a row of the grid.
double RootAheadM(std::span<const float> row, Foot foot, const GridLayout& layout,
                  const Skeleton& skeleton) {
  const Pose pose = PoseOfRow(row, layout, skeleton.joint_count());
  return double{pose.root_position_m.z} - double{BallPosition(skeleton, pose, foot).z};
}

bool Increases(std::span<const double> values) {
  return std::ranges::adjacent_find(values, std::greater_equal<>()) == values.end();
}

}  // namespace

std::vector<double> TimesOfBlend(const MotionGroup& group, const GridLayout& layout,
                                 const Skeleton& skeleton, const GridExample& captured) {
  Movement movement;
  BlendFor(captured.parameters, group, movement);
  GridCache cache(layout);
  const Foot standing = OtherFoot(MovingFoot(group.kind));
  const TimeWarp warp(captured.keytimes_s, group.cells);
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  std::vector<double> times_s;
  std::vector<double> captured_m;
  std::vector<double> blended_m;
  for (int p = 0; p < group.grid_point_count; ++p) {
    const auto row =
        std::span(captured.rows).subspan(static_cast<std::size_t>(p) * row_floats, row_floats);
    times_s.push_back(warp.TimeAt(p));
    captured_m.push_back(RootAheadM(row, standing, layout, skeleton));
    blended_m.push_back(
        RootAheadM(cache.Row(group, movement.weights, p), standing, layout, skeleton));
  }
  if (!Increases(captured_m) || !Increases(blended_m)) return times_s;

  const double scale =
      (captured_m.back() - captured_m.front()) / (blended_m.back() - blended_m.front());
  std::vector<double> matched_s = times_s;
  std::size_t k = 0;
  for (std::size_t p = 1; p + 1 < matched_s.size(); ++p) {
    const double at_m = captured_m.front() + scale * (blended_m[p] - blended_m.front());
    while (k + 2 < captured_m.size() && captured_m[k + 1] < at_m) ++k;
    const double part = (at_m - captured_m[k]) / (captured_m[k + 1] - captured_m[k]);
    matched_s[p] = times_s[k] + part * (times_s[k + 1] - times_s[k]);
  }
  return matched_s;
}

void AdaptToBlend(const MotionGroup& group, const GridLayout& layout, GridExample& variant) {
  Movement movement;
  BlendFor(variant.parameters, group, movement);
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
