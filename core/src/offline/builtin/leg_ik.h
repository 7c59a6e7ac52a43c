#pragma once

#include "offline/builtin/figure.h"
#include "offline/builtin/foot_path.h"

namespace stridewire::builtin {

/// Returns the distance from hip to ankle in metres for a knee angle. At angle 0 the leg is
/// straight.
[[nodiscard]] double ReachAtKnee(double knee_rad);

/// Returns the maximum height of a hip, on the vertical line through `hip_m`, at which it is at
/// most `reach_m` from the ankle. Returns the height of the ankle if that line is further away.
[[nodiscard]] double HighestHipM(const DVec3& hip_m, const DVec3& ankle_m, double reach_m);

/// Sets the rotations of hip, knee, ankle and toe joint of one leg so that the foot has the pose
/// `target`. The knee is a hinge about its x axis and points in the direction of the foot. If the
/// body is turned relative to the foot, the knee points halfway between the foot and `heading_rad`.
/// If the pose is out of reach, the leg is almost straight and the foot does not reach it.
void SolveLeg(Foot foot, const FootPose& target, FigurePose& pose, double heading_rad = 0.0);

}  // namespace stridewire::builtin
