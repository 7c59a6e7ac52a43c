#include "offline/builtin/leg_ik.h"

#include <algorithm>
#include <cmath>

#include "base/trig.h"

namespace stridewire::builtin {
namespace {

// Returns the rotation with y axis `up` and x axis `left`, which must be orthonormal.
DQuat FromAxes(const DVec3& left, const DVec3& up) {
  const DVec3 forward = glm::cross(left, up);
  return glm::normalize(glm::quat_cast(glm::dmat3(left, up, forward)));
}

}  // namespace

double ReachAtKnee(double knee_rad) {
  return std::sqrt(kThighM * kThighM + kShankM * kShankM + 2.0 * kThighM * kShankM * Cos(knee_rad));
}

double HighestHipM(const DVec3& hip_m, const DVec3& ankle_m, double reach_m) {
  const double dx = hip_m.x - ankle_m.x;
  const double dz = hip_m.z - ankle_m.z;
  return ankle_m.y + std::sqrt(std::max(0.0, reach_m * reach_m - dx * dx - dz * dz));
}

void SolveLeg(Foot foot, const FootPose& target, FigurePose& pose, double heading_rad) {
  const std::size_t hip = foot == Foot::kLeft ? kLeftUpLeg : kRightUpLeg;
  const double side = SideSign(foot);
  const DQuat pelvis = pose.rotations[kHips];
  const DVec3 hip_m = pose.root_m + pelvis * DVec3(side * kHipHalfWidthM, 0.0, 0.0);
  const DVec3 to_hip = hip_m - target.ankle_m;
  const double least = std::fabs(kThighM - kShankM) + 1e-6;
  const double distance =
      std::clamp(std::sqrt(glm::dot(to_hip, to_hip)), least, ReachAtKnee(1.0 * kDegree));
  const DVec3 up = to_hip / std::sqrt(glm::dot(to_hip, to_hip));
  const double knee_yaw = 0.5 * (target.yaw_rad + heading_rad) + side * kToeOutRad;
  const DVec3 ahead(Sin(knee_yaw), 0.0, Cos(knee_yaw));
  DVec3 left = glm::cross(up, ahead);
  left /= std::sqrt(glm::dot(left, left));
  const DVec3 forward = glm::cross(left, up);

  // The angle at the hip between the thigh and the line to the ankle follows from the law of
  // cosines.
  const double at_hip = Acos((kThighM * kThighM + distance * distance - kShankM * kShankM) /
                             (2.0 * kThighM * distance));
  const double at_ankle = Acos((kShankM * kShankM + distance * distance - kThighM * kThighM) /
                               (2.0 * kShankM * distance));
  const DVec3 thigh_up = Cos(at_hip) * up - Sin(at_hip) * forward;
  const DVec3 shank_up = Cos(at_ankle) * up + Sin(at_ankle) * forward;
  const DQuat thigh = FromAxes(left, thigh_up);
  const DQuat shank = FromAxes(left, shank_up);
  const DQuat sole = FootRotation(foot, target.pitch_rad, target.yaw_rad);
  pose.rotations[hip] = glm::conjugate(pelvis) * thigh;
  pose.rotations[hip + 1] = glm::conjugate(thigh) * shank;
  pose.rotations[hip + 2] = glm::conjugate(shank) * sole;
  pose.rotations[hip + 3] = RotateX(target.pitch_rad - target.toe_pitch_rad);
}

}  // namespace stridewire::builtin
