#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

namespace stridewire {

/// Conventions: coordinates are right-handed with +Y up. Figures face +Z, and +X is to their left.
/// Units are metres, seconds and radians. Quaternions have unit length and are stored as x, y, z, w
/// (glm's constructor takes w first). A vector is rotated by v' = q v q^-1, and the world rotation
/// of a child is parent * local. Positive headings turn left.
using Vec3 = glm::vec3;
using DVec3 = glm::dvec3;
using Quat = glm::quat;
using DQuat = glm::dquat;

static_assert(sizeof(Quat) == 16 && sizeof(Vec3) == 12);

inline constexpr Quat kIdentityQuat = Quat(1.0f, 0.0f, 0.0f, 0.0f);

/// Returns the rotation by a = `yaw_rad` about +Y: (0, sin a/2, 0, cos a/2) in x, y, z, w. The
/// result has the same bits on every machine.
[[nodiscard]] Quat YawRotation(double yaw_rad);

/// Computes the heading of a rotation: atan2(z'_x, z'_z) with z' = q z q^-1 (paper, Section 5). If
/// z' is within 1e-3 rad of vertical, returns false and leaves `heading_rad` unchanged.
bool HeadingOf(const Quat& rotation, double& heading_rad);

/// Returns v rotated by `yaw_rad` about +Y.
[[nodiscard]] DVec3 RotateYaw(double yaw_rad, const DVec3& v);

/// Adds the multiple of 2 pi to `angle_rad` that brings it closest to `reference_rad`.
[[nodiscard]] double UnwrapAngle(double angle_rad, double reference_rad);

/// Wraps an angle to (-pi, pi].
[[nodiscard]] double WrapAngle(double angle_rad);

/// Returns q / |q|, or the identity if |q| <= 1e-12 or q contains NaN. The result has the same bits
/// on every machine, because the function uses only correctly rounded operations.
[[nodiscard]] Quat Normalise(const Quat& q);

/// Returns slerp(1, q, fraction) along the shorter arc, with `fraction` in [0, 1]. If w < 0, it is
/// computed from -q, which is the same rotation. Half of a rotation by 6 degrees is therefore a
/// rotation by 3 degrees, not by 177. The result has the same bits on every machine.
[[nodiscard]] Quat SlerpFromIdentity(const Quat& q, float fraction);

/// Returns the angle of the rotation a^-1 b, in [0, pi].
[[nodiscard]] double AngleBetween(const Quat& a, const Quat& b);

[[nodiscard]] inline float Dot(const Quat& a, const Quat& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}

}  // namespace stridewire
