#include "offline/build/error_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/check.h"
#include "offline/base/parallel.h"
#include "offline/build/hull_survey.h"
#include "offline/build/parameter_scales.h"
#include "runtime/library/convex_hull.h"

namespace stridewire {
namespace {

// Points outside the hull by at most this distance, in scaled parameters, count as inside.
constexpr double kInside = 1e-6;

std::vector<double> Axis(const Parameter& parameter, int count) {
  std::vector<double> values(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    values[static_cast<std::size_t>(i)] =
        parameter.min + (parameter.max - parameter.min) * i / std::max(1, count - 1);
  }
  return values;
}

}  // namespace

Expected<ErrorMap> MeasureErrorMap(const MotionLibrary& library, int group_index,
                                   const ErrorMapOptions& options) {
  if (group_index < 0 || group_index >= static_cast<int>(library.groups().size())) {
    return Fail(ErrorCode::kOutOfRange, "there is no such group", group_index);
  }
  const MotionGroup& group = library.group(group_index);
  const int d = group.parameter_count();
  if (options.axis_x < 0 || options.axis_x >= d || options.axis_y < -1 || options.axis_y >= d ||
      options.axis_x == options.axis_y) {
    return Fail(ErrorCode::kOutOfRange, "an axis is not a parameter of the group", group_index);
  }
  const auto is_count = [](int n) { return n >= 2 && n <= ErrorMapOptions::kMaxPoints; };
  if (!is_count(options.columns) || !is_count(options.rows)) {
    return Fail(ErrorCode::kOutOfRange, "expected 2 to 1000 columns and rows");
  }

  const auto n = static_cast<std::size_t>(group.example_count);
  const auto width = static_cast<std::size_t>(d);
  const std::span<const double> examples = group.sites.first(n * width);
  ErrorMap map;
  map.others.assign(width, 0.0);
  for (std::size_t i = 0; i < examples.size(); ++i) {
    map.others[i % width] += examples[i] / static_cast<double>(n);
  }
  const auto axis_x = static_cast<std::size_t>(options.axis_x);
  map.x = Axis(group.parameters[axis_x], options.columns);
  if (options.axis_y >= 0) {
    map.y = Axis(group.parameters[static_cast<std::size_t>(options.axis_y)], options.rows);
  } else {
    map.y = {0.0};
  }
  const std::vector<double> metric = MetricOf(group);

  const std::size_t count = map.x.size() * map.y.size();
  map.error_m.resize(count);
  map.weight_sum.resize(count);
  std::vector<GroupProbe> probes = MakeProbes(library, 0);
  STRIDEWIRE_CHECK(!probes.empty() && map.others.size() == width);
  ParallelFor(static_cast<int>(count), 16, static_cast<int>(probes.size()), [&](int i, int thread) {
    const auto at = static_cast<std::size_t>(i);
    ParameterValues p = ValuesOf(map.others);
    p.values[axis_x] = map.x[at % map.x.size()];
    if (options.axis_y >= 0) {
      p.values[static_cast<std::size_t>(options.axis_y)] = map.y[at / map.x.size()];
    }
    std::array<double, kMaxParameters> nearest{};
    const double outside = ProjectOntoHull(examples, metric, 0.0, std::span(p.values).first(width),
                                           std::span(nearest).first(width));
    const HullPoint point =
        outside <= kInside ? probes[static_cast<std::size_t>(thread)].At(group, p) : HullPoint{};
    const double nothing = std::numeric_limits<double>::quiet_NaN();
    map.error_m[at] = outside <= kInside ? point.error_m : nothing;
    map.weight_sum[at] = outside <= kInside ? point.weight_sum : nothing;
  });
  for (const double error_m : map.error_m) {
    if (error_m > map.max_error_m) map.max_error_m = error_m;
  }
  return map;
}

}  // namespace stridewire
