#include "stridewire/base/math.h"

#include <cmath>
#include <numbers>

#include "base/trig.h"

namespace stridewire {

namespace {
constexpr double kTwoPi = 2.0 * std::numbers::pi;
}

Quat YawRotation(double yaw_rad) {
  return Quat(static_cast<float>(Cos(0.5 * yaw_rad)), 0.0f, static_cast<float>(Sin(0.5 * yaw_rad)),
              0.0f);
}

bool HeadingOf(const Quat& rotation, double& heading_rad) {
  const double x = rotation.x, y = rotation.y, z = rotation.z, w = rotation.w;
  const double zx = 2.0 * (x * z + w * y);
  const double zz = 1.0 - 2.0 * (x * x + y * y);
  if (zx * zx + zz * zz < 1e-6) return false;
  heading_rad = Atan2(zx, zz);
  return true;
}

DVec3 RotateYaw(double yaw_rad, const DVec3& v) {
  const double s = Sin(yaw_rad);
  const double c = Cos(yaw_rad);
  return {c * v.x + s * v.z, v.y, c * v.z - s * v.x};
}

double UnwrapAngle(double angle_rad, double reference_rad) {
  return angle_rad - kTwoPi * std::nearbyint((angle_rad - reference_rad) / kTwoPi);
}

double WrapAngle(double angle_rad) {
  const double wrapped = UnwrapAngle(angle_rad, 0.0);
  return wrapped <= -std::numbers::pi ? wrapped + kTwoPi : wrapped;
}

Quat Normalise(const Quat& q) {
  const float norm = std::sqrt(Dot(q, q));
  if (!(norm > 1e-12f)) return kIdentityQuat;
  return Quat(q.w / norm, q.x / norm, q.y / norm, q.z / norm);
}

Quat SlerpFromIdentity(const Quat& q, float fraction) {
  const double sign = q.w < 0.0f ? -1.0 : 1.0;
  const double x = sign * q.x, y = sign * q.y, z = sign * q.z, w = sign * q.w;
  const double sine = std::sqrt(x * x + y * y + z * z);
  if (sine < 1e-9) return kIdentityQuat;
  const double half = Atan2(sine, w) * fraction;
  const double k = Sin(half) / sine;
  return Quat(static_cast<float>(Cos(half)), static_cast<float>(k * x), static_cast<float>(k * y),
              static_cast<float>(k * z));
}

double AngleBetween(const Quat& a, const Quat& b) {
  const DQuat d = glm::conjugate(DQuat(a)) * DQuat(b);
  const double s2 = d.x * d.x + d.y * d.y + d.z * d.z;
  const double w2 = d.w * d.w;
  if (s2 >= 0.01 * w2) return 2.0 * Atan2(std::sqrt(s2), std::fabs(d.w));
  // Most angles are small, for example those between successive frames. The angle is 2 atan(t) with
  // t^2 = s2 / w2. For t <= 0.1, the first omitted term of the series is below 2e-16 rad.
  const double t2 = s2 / w2;
  constexpr double kSeries[] = {-1.0 / 3.0, 1.0 / 5.0,   -1.0 / 7.0,
                                1.0 / 9.0,  -1.0 / 11.0, 1.0 / 13.0};
  return 2.0 * std::sqrt(t2) *
         (1.0 + t2 * (kSeries[0] +
                      t2 * (kSeries[1] +
                            t2 * (kSeries[2] +
                                  t2 * (kSeries[3] + t2 * (kSeries[4] + t2 * kSeries[5]))))));
}

}  // namespace stridewire
