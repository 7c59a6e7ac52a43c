#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "runtime/skeleton/leg_rig.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire::complete {

/// A pose in double precision, with the positions of its feet for inverse kinematics. Positions and
/// ankle rotations are in the heading frame.
struct PostureSample {
  DVec3 root_m = DVec3(0.0);
  /// [joint]: rotation relative to the parent or, for the root, to the heading.
  std::vector<DQuat> rotations;
  std::array<DQuat, 2> ankles;                           ///< [Foot]: rotation of the ankle.
  std::array<DVec3, 2> balls_m{DVec3(0.0), DVec3(0.0)};  ///< [Foot]: position of the ball.
};

/// Returns the normalised linear blend of two rotations along the shorter arc. It uses only
/// correctly rounded operations, so the result has the same bits on every machine. It does not
/// depend on the axes of joints: if both rotations are multiplied by a constant rotation, the
/// result is multiplied by it as well.
[[nodiscard]] inline DQuat Blend(const DQuat& a, const DQuat& b, double share_of_b) {
  const double sign = glm::dot(a, b) < 0.0 ? -1.0 : 1.0;
  const DQuat sum = a * (1.0 - share_of_b) + b * (sign * share_of_b);
  const double length = std::sqrt(glm::dot(sum, sum));
  return length > 1e-9 ? sum * (1.0 / length) : a;
}

/// Blends all members of two samples: positions linearly, and rotations as above.
[[nodiscard]] PostureSample Blend(const PostureSample& a, const PostureSample& b,
                                  double share_of_b);

/// Writes the blend of two samples to `out`, whose memory it reuses. `out` may be `a` or `b`.
void Blend(const PostureSample& a, const PostureSample& b, double share_of_b, PostureSample& out);

/// Blends only the root position and the feet of two samples. Does not change the rotations of
/// `out`.
void BlendFeet(const PostureSample& a, const PostureSample& b, double share_of_b,
               PostureSample& out);

/// Converts a pose with the heading `heading_rad` to a sample, and measures its feet.
[[nodiscard]] PostureSample SampleOf(const Skeleton& skeleton, ConstPoseSpan pose,
                                     double heading_rad);

/// Returns the position of the root relative to the ground below the midpoint between the balls.
[[nodiscard]] DVec3 RootFromFeet(const PostureSample& sample);

/// Returns the distance from hip to ankle if the ball of the foot is at its position in the sample.
[[nodiscard]] double LegLength(const Skeleton& skeleton, const LegRig& rig,
                               const PostureSample& sample, Foot foot);

/// Converts a sample to a pose in single precision.
[[nodiscard]] Pose ToPose(const PostureSample& sample);

}  // namespace stridewire::complete
