#include "runtime/library/locomotion_profile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "runtime/skeleton/foot_vector.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {
namespace {

// The comfortable step length is the median of the captured strides, but at least
// kLeastComfortablePart and at most kMostComfortablePart of the longest step, and at most
// kMaxComfortableM.
constexpr double kLeastComfortablePart = 0.8;
constexpr double kMostComfortablePart = 0.83;
constexpr double kMaxComfortableM = 0.62;
// The width of a walk is taken from examples that step at least kStrideM forward and turn by at
// most kStraightRad. Examples with the feet closer than kLeastWidthM sideways are ignored.
constexpr double kStrideM = 0.3;
constexpr double kStraightRad = 0.2;
constexpr double kLeastWidthM = 0.08;
// Examples whose feet differ in height by at most this are level.
constexpr double kLevelM = 0.05;

// Lengths and widths of the level steps of a library.
struct StepRanges {
  double longest_m = 0.0;
  double back_m = 0.0;
  // [foot]: shortest step forward; infinity if the foot has no step.
  std::array<double, 2> shortest_m{HUGE_VAL, HUGE_VAL};
  double narrowest_m = HUGE_VAL;
  double width_sum_m = 0.0;
  int widths = 0;
  // Lengths of captured steps that begin and end in a stride.
  std::vector<double> strides_m;
};

double MedianOr(std::vector<double> values, double otherwise) {
  if (values.empty()) return otherwise;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

void AddGroup(const MotionGroup& group, StepRanges& ranges) {
  const int end_z = group.FindParameter(ParameterName::kEndZ);
  const int turn = group.FindParameter(ParameterName::kTurn);
  const int end_x = group.FindParameter(ParameterName::kEndX);
  const int start_z = group.FindParameter(ParameterName::kStartZ);
  const int start_x = group.FindParameter(ParameterName::kStartX);
  const int heights[] = {group.FindParameter(ParameterName::kStartY),
                         group.FindParameter(ParameterName::kEndY)};
  const int x = end_x >= 0 ? end_x : start_x;
  const Foot foot = MovingFoot(group.kind);
  const double outward = SideSign(foot);
  double& shortest_m = ranges.shortest_m[static_cast<std::size_t>(foot)];
  for (int s = 0; s < group.example_count; ++s) {
    const auto site = group.site(s);
    const auto is_uneven = [&](int l) {
      return l >= 0 && std::fabs(site[static_cast<std::size_t>(l)]) > kLevelM;
    };
    if (is_uneven(heights[0]) || is_uneven(heights[1])) continue;
    const double length_m = site[static_cast<std::size_t>(end_z)];
    ranges.longest_m = std::max(ranges.longest_m, length_m);
    ranges.back_m = std::max(ranges.back_m, -length_m);
    shortest_m = std::min(shortest_m, std::max(length_m, 0.0));
    const double start_m = start_z < 0 ? 0.0 : -site[static_cast<std::size_t>(start_z)];
    if (!group.is_completed && std::min(start_m, length_m) >= kStrideM) {
      ranges.strides_m.push_back(length_m);
    }
    if (x < 0) continue;
    const double side_m = outward * site[static_cast<std::size_t>(x)];
    if (length_m < kStrideM || side_m < kLeastWidthM) continue;
    if (turn >= 0 && std::fabs(site[static_cast<std::size_t>(turn)]) > kStraightRad) continue;
    ranges.narrowest_m = std::min(ranges.narrowest_m, side_m);
    ranges.width_sum_m += side_m;
    ++ranges.widths;
  }
}

// Returns the ranges of the groups for level ground. If there are none, returns those of the level
// examples in the groups for uneven ground.
StepRanges RangesOf(const MotionLibrary& library) {
  StepRanges ranges;
  for (const bool is_uneven : {false, true}) {
    for (const MotionGroup& group : library.groups()) {
      if (!IsStep(group.kind) || group.FindParameter(ParameterName::kEndZ) < 0) continue;
      if ((group.FindParameter(ParameterName::kEndY) >= 0) != is_uneven) continue;
      AddGroup(group, ranges);
    }
    if (ranges.longest_m > 0.0) break;
  }
  return ranges;
}

}  // namespace

LocomotionProfile MakeLocomotionProfile(const MotionLibrary& library) {
  LocomotionProfile profile;
  const Pose& stand = library.stand_pose();
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    DVec3 ball = DVec3(BallPosition(library.skeleton(), stand, foot)) -
                 DVec3(stand.root_position_m.x, 0.0, stand.root_position_m.z);
    ball.y = 0.0;
    profile.stand_feet_m[static_cast<std::size_t>(foot)] = ball;
  }
  const std::array<DVec3, 2>& feet = profile.stand_feet_m;
  profile.stand_m = std::max(feet[0].x - feet[1].x, kLeastWidthM);
  profile.stands_in_stride = std::fabs(feet[0].z - feet[1].z) > kFeetApartForwardM;

  profile.has_climbs = std::ranges::any_of(library.groups(), [](const MotionGroup& group) {
    return IsStep(group.kind) && group.FindParameter(ParameterName::kEndY) >= 0;
  });

  StepRanges ranges = RangesOf(library);
  if (ranges.longest_m > 0.0) {
    profile.longest_m = ranges.longest_m;
    profile.shortest_m =
        std::min(std::max(ranges.shortest_m[0], ranges.shortest_m[1]), ranges.longest_m);
    const double comfortable_m = std::clamp(MedianOr(std::move(ranges.strides_m), 0.0),
                                            kLeastComfortablePart * ranges.longest_m,
                                            kMostComfortablePart * ranges.longest_m);
    profile.step_m = std::max(std::min(comfortable_m, kMaxComfortableM), profile.shortest_m);
  }
  profile.back_m = 0.75 * ranges.back_m;
  profile.width_m = 0.7 * profile.stand_m;
  if (ranges.widths > 0) {
    const double narrowest_m = std::min(ranges.narrowest_m, profile.stand_m);
    const double mean_m = std::min(ranges.width_sum_m / ranges.widths, profile.stand_m);
    profile.width_m = 0.5 * (narrowest_m + mean_m);
  }
  profile.width_m = std::min(profile.width_m, profile.stand_m);
  return profile;
}

}  // namespace stridewire
