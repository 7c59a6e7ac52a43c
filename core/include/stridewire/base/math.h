#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

namespace stridewire {

/// Conventions: right-handed, +Y up, figures face +Z, +X is the figure's left; metres, seconds,
/// radians. Quaternions are unit, in memory x, y, z, w (glm's constructor takes w first);
/// v' = q v q^-1, and a child's world rotation is parent * local. Headings turn left when positive.
using Vec3 = glm::vec3;
using DVec3 = glm::dvec3;
using Quat = glm::quat;
using DQuat = glm::dquat;

static_assert(sizeof(Quat) == 16 && sizeof(Vec3) == 12);

inline constexpr Quat kIdentityQuat = Quat(1.0f, 0.0f, 0.0f, 0.0f);

/// Rotation about +Y: (0, sin a/2, 0, cos a/2) in x, y, z, w. Same bits on every machine.
[[nodiscard]] Quat YawRotation(double yaw_rad);

/// Heading of a rotation: atan2(z'_x, z'_z) with z' = q z q^-1 (method: Section "Normalisation").
/// False, leaving `heading_rad` as it is, when z' is within 1e-3 of vertical.
bool HeadingOf(const Quat& rotation, double& heading_rad);

/// v turned by `yaw_rad` about +Y.
[[nodiscard]] DVec3 RotateYaw(double yaw_rad, const DVec3& v);

/// `angle_rad` plus the multiple of 2 pi that brings it nearest to `reference_rad`.
[[nodiscard]] double UnwrapAngle(double angle_rad, double reference_rad);

/// `angle_rad` brought into (-pi, pi].
[[nodiscard]] double WrapAngle(double angle_rad);

/// Unit quaternion along q; the identity when |q| < 1e-12. sqrt and divide only.
[[nodiscard]] Quat Normalise(const Quat& q);

/// slerp(1, q, fraction) along the short arc: q is negated first if its w < 0 (else a difference
/// of 6 degrees shows as 177 half-way). `fraction` in [0, 1]. Same bits on every machine.
[[nodiscard]] Quat SlerpFromIdentity(const Quat& q, float fraction);

/// Angle of the rotation a^-1 b, in [0, pi].
[[nodiscard]] double AngleBetween(const Quat& a, const Quat& b);

[[nodiscard]] inline float Dot(const Quat& a, const Quat& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}

}  // namespace stridewire
