#include "runtime/weights/measure.h"

#include <algorithm>
#include <cmath>

#include "runtime/pose/evaluate_poses.h"
#include "runtime/skeleton/foot_vector.h"
#include "runtime/weights/end_measures.h"

namespace stridewire {
namespace {

struct Feet {
  DVec3 left;
  DVec3 right;
  [[nodiscard]] DVec3 Centre() const { return 0.5 * (left + right); }
};

Feet FeetOf(const Skeleton& skeleton, ConstPoseSpan pose) {
  return {DVec3(BallPosition(skeleton, pose, Foot::kLeft)),
          DVec3(BallPosition(skeleton, pose, Foot::kRight))};
}

}  // namespace

ParameterValues MeasureMovement(const MotionLibrary& library, const Movement& movement,
                                GridCache& cache, PoseSpan pose) {
  return MeasureMovement(library.skeleton(), library.layout(), library.group(movement.group),
                         movement, cache, pose);
}

ParameterValues MeasureMovement(const Skeleton& skeleton, const GridLayout& layout,
                                const MotionGroup& group, const Movement& movement,
                                GridCache& cache, PoseSpan pose) {
  EvaluateGridPoint(group, layout, movement, 0, cache, pose);
  const Feet before = FeetOf(skeleton, pose);
  EvaluateGridPoint(group, layout, movement, group.grid_point_count - 1, cache, pose);
  const Feet after = FeetOf(skeleton, pose);

  const double sign = group.kind == MovementKind::kStepRight ? -1.0 : 1.0;
  const double start_heading = movement.base.heading_rad;
  const double end_heading = start_heading + movement.heading_change_rad;
  return ParametersOf(group,
                      {.start_m = sign * RotateYaw(-start_heading, before.left - before.right),
                       .end_m = sign * RotateYaw(-end_heading, after.left - after.right),
                       .travel_m = RotateYaw(-start_heading, after.Centre() - before.Centre()),
                       .heading_change_rad = movement.heading_change_rad});
}

double LargestDifference(const MotionGroup& group, const ParameterValues& a,
                         const ParameterValues& b) {
  double largest = 0.0;
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    const double unit = group.parameters[l].name == ParameterName::kTurn ? kMetresPerRadian : 1.0;
    largest = std::max(largest, unit * std::fabs(a.values[l] - b.values[l]));
  }
  return largest;
}

}  // namespace stridewire
