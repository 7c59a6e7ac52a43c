#pragma once

#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Returns +1 for the left side (+X) and -1 for the right side (-X).
[[nodiscard]] constexpr double SideSign(Foot foot) { return foot == Foot::kLeft ? 1.0 : -1.0; }

/// Returns the position of the moving foot relative to the fixed foot, from ball to ball, in the
/// heading frame: d = R_y(-heading)(F_moving - F_fixed), in metres. The parameters of a general
/// step are d at its start and at its end.
[[nodiscard]] inline DVec3 FootVector(const Skeleton& skeleton, ConstPoseSpan pose, Foot moving,
                                      double heading_rad) {
  const DVec3 difference = DVec3(BallPosition(skeleton, pose, moving)) -
                           DVec3(BallPosition(skeleton, pose, OtherFoot(moving)));
  return RotateYaw(-heading_rad, difference);
}

}  // namespace stridewire
