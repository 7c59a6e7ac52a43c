#pragma once

#include "stridewire/runtime/pose.h"

namespace stridewire {

/// d = R_y(-heading)(F_moving - F_fixed): where the moving foot stands from the fixed one, in a
/// heading frame, ball to ball, metres. A general step's parameters are d at its start and end.
[[nodiscard]] inline DVec3 FootVector(const Skeleton& skeleton, ConstPoseSpan pose, Foot moving,
                                      double heading_rad) {
  const DVec3 difference = DVec3(BallPosition(skeleton, pose, moving)) -
                           DVec3(BallPosition(skeleton, pose, OtherFoot(moving)));
  return RotateYaw(-heading_rad, difference);
}

}  // namespace stridewire
