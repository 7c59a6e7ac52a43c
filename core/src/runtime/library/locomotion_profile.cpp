#include "runtime/library/locomotion_profile.h"

#include <algorithm>
#include <cmath>

#include "runtime/skeleton/foot_vector.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {
namespace {

// The comfortable step length is this fraction of the longest step, but at most kMaxComfortableM.
constexpr double kComfortablePart = 0.8;
constexpr double kMaxComfortableM = 0.62;
// The width of a walk is taken from examples that step at least kStrideM forward and turn by at
// most kStraightRad. Examples with the feet closer than kLeastWidthM sideways are ignored.
constexpr double kStrideM = 0.3;
constexpr double kStraightRad = 0.2;
constexpr double kLeastWidthM = 0.08;

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
  profile.stand_m = std::max(profile.stand_feet_m[0].x - profile.stand_feet_m[1].x, kLeastWidthM);

  double longest_m = 0.0;
  double back_m = 0.0;
  double width_m = 0.0;
  int widths = 0;
  double narrowest_m = profile.stand_m;
  for (const MotionGroup& group : library.groups()) {
    if (!IsStep(group.kind)) continue;
    const int end_z = group.FindParameter(ParameterName::kEndZ);
    const int turn = group.FindParameter(ParameterName::kTurn);
    const int end_y = group.FindParameter(ParameterName::kEndY);
    const int end_x = group.FindParameter(ParameterName::kEndX);
    const int start_x = group.FindParameter(ParameterName::kStartX);
    if (end_z < 0 || end_y >= 0) continue;
    longest_m = std::max(longest_m, group.parameters[static_cast<std::size_t>(end_z)].max);
    back_m = std::max(back_m, -group.parameters[static_cast<std::size_t>(end_z)].min);
    const int x = end_x >= 0 ? end_x : start_x;
    if (x < 0) continue;
    const double outward = MovingFoot(group.kind) == Foot::kLeft ? 1.0 : -1.0;
    for (int s = 0; s < group.example_count; ++s) {
      const auto site = group.site(s);
      const double side_m = outward * site[static_cast<std::size_t>(x)];
      if (site[static_cast<std::size_t>(end_z)] < kStrideM || side_m < kLeastWidthM) continue;
      if (turn >= 0 && std::fabs(site[static_cast<std::size_t>(turn)]) > kStraightRad) continue;
      narrowest_m = std::min(narrowest_m, side_m);
      width_m += side_m;
      ++widths;
    }
  }
  if (longest_m > 0.0) {
    profile.longest_m = longest_m;
    profile.step_m = std::min(kComfortablePart * longest_m, kMaxComfortableM);
  }
  profile.back_m = 0.75 * back_m;
  if (widths > 0) width_m = std::min(width_m / widths, profile.stand_m);
  profile.width_m = widths > 0 ? 0.5 * (narrowest_m + width_m) : 0.7 * profile.stand_m;
  profile.width_m = std::min(profile.width_m, profile.stand_m);
  return profile;
}

}  // namespace stridewire
