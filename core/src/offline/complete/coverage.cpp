#include "offline/complete/coverage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "runtime/library/convex_hull.h"
#include "runtime/weights/end_measures.h"
#include "runtime/weights/measure.h"

namespace stridewire::complete {
namespace {

// A step this close to the enlarged hull of captured steps counts as captured.
constexpr double kCloseM = 0.06;
// Sideways tolerance of groups without sideways parameters.
constexpr double kSideSlackM = 0.12;
constexpr double kHullGrowth = 0.1;

double DistanceTo(const RawGroup& group, const StepFeet& feet, double stand_side_m) {
  std::vector<double> points;
  for (const RawExample& example : group.examples) {
    points.insert(points.end(), example.parameters.begin(), example.parameters.end());
  }
  const EndMeasures ends = {
      .start_m = feet.start_m, .end_m = feet.end_m, .heading_change_rad = feet.turn_rad};
  std::array<double, kMaxParameters> metric{};
  std::array<double, kMaxParameters> target{};
  std::array<double, kMaxParameters> nearest{};
  const std::size_t d = group.parameters.size();
  bool has_start_x = false;
  bool has_end_x = false;
  bool has_turn = false;
  for (std::size_t l = 0; l < d; ++l) {
    const ParameterName name = group.parameters[l];
    has_start_x |= name == ParameterName::kStartX;
    has_end_x |= name == ParameterName::kEndX;
    has_turn |= name == ParameterName::kTurn;
    metric[l] = name == ParameterName::kTurn ? kMetresPerRadian : 1.0;
    target[l] = ParameterOf(ends, name);
  }
  const auto beyond_slack = [&](double side_m) {
    return std::max(0.0, std::fabs(side_m - stand_side_m) - kSideSlackM);
  };
  double distance_m = ProjectOntoHull(points, std::span(metric).first(d), kHullGrowth,
                                      std::span(target).first(d), std::span(nearest).first(d));
  if (!has_start_x) distance_m += beyond_slack(feet.start_m.x);
  if (!has_end_x) distance_m += beyond_slack(feet.end_m.x);
  if (!has_turn) distance_m += kMetresPerRadian * std::fabs(feet.turn_rad);
  return distance_m;
}

}  // namespace

bool IsCaptured(const RawLibrary& library, Foot moving, const StepFeet& feet, double stand_side_m) {
  return std::ranges::any_of(library.groups, [&](const RawGroup& group) {
    return !group.is_completed && group.kind == StepKind(moving) && !group.examples.empty() &&
           group.examples.size() <= MotionLibrary::kMaxExamples &&
           DistanceTo(group, feet, stand_side_m) <= kCloseM;
  });
}

}  // namespace stridewire::complete
