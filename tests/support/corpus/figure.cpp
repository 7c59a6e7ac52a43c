#include "corpus/figure.h"

#include <algorithm>
#include <cmath>

namespace stridewire::test {
namespace {

constexpr double kThighShare = 0.5;

struct PartSpec {
  Part parent;
  DVec3 offset_m;
};

constexpr int kNoParent = -1;

PartSpec Spec(Part part) {
  switch (part) {
    case Part::kHips: return {Part::kHips, {0, 0, 0}};
    case Part::kLeftUpLeg: return {Part::kHips, {0.09, 0, 0}};
    case Part::kLeftLeg: return {Part::kLeftUpLeg, {0, -0.43, 0}};
    case Part::kLeftFoot: return {Part::kLeftLeg, {0, -0.43, 0}};
    case Part::kLeftToes: return {Part::kLeftFoot, {0, -0.055, 0.13}};
    case Part::kRightUpLeg: return {Part::kHips, {-0.09, 0, 0}};
    case Part::kRightLeg: return {Part::kRightUpLeg, {0, -0.43, 0}};
    case Part::kRightFoot: return {Part::kRightLeg, {0, -0.43, 0}};
    case Part::kRightToes: return {Part::kRightFoot, {0, -0.055, 0.13}};
    case Part::kSpine: return {Part::kHips, {0, 0.12, 0}};
    case Part::kChest: return {Part::kSpine, {0, 0.20, 0}};
    case Part::kNeck: return {Part::kChest, {0, 0.22, 0}};
    case Part::kHead: return {Part::kNeck, {0, 0.08, 0.02}};
    case Part::kLeftShoulder: return {Part::kChest, {0.04, 0.18, 0}};
    case Part::kLeftArm: return {Part::kLeftShoulder, {0.14, 0, 0}};
    case Part::kLeftForeArm: return {Part::kLeftArm, {0.28, 0, 0}};
    case Part::kLeftHand: return {Part::kLeftForeArm, {0.25, 0, 0}};
    case Part::kRightShoulder: return {Part::kChest, {-0.04, 0.18, 0}};
    case Part::kRightArm: return {Part::kRightShoulder, {-0.14, 0, 0}};
    case Part::kRightForeArm: return {Part::kRightArm, {-0.28, 0, 0}};
    case Part::kRightHand: return {Part::kRightForeArm, {-0.25, 0, 0}};
  }
  return {};
}

DQuat AboutAxis(double angle_rad, int axis) {
  DQuat q(std::cos(0.5 * angle_rad), 0.0, 0.0, 0.0);
  (axis == 0 ? q.x : axis == 1 ? q.y : q.z) = std::sin(0.5 * angle_rad);
  return q;
}

DQuat FromAxes(const DVec3& x, const DVec3& y) {
  return glm::normalize(glm::quat_cast(glm::dmat3(x, y, glm::cross(x, y))));
}

// World rotations of thigh and shank.
std::array<DQuat, 2> BendLeg(const DVec3& hip, const FigurePose::LegPose& leg, double leg_m) {
  const double thigh_m = kThighShare * leg_m;
  const double shank_m = leg_m - thigh_m;
  const DVec3 to_ankle = leg.ankle_m - hip;
  const double distance = std::min(glm::length(to_ankle), 0.9999 * leg_m);
  const DVec3 down = to_ankle / glm::length(to_ankle);
  const DVec3 ahead = glm::normalize(leg.knee_towards - glm::dot(leg.knee_towards, down) * down);
  const double cosine =
      (thigh_m * thigh_m + distance * distance - shank_m * shank_m) / (2.0 * thigh_m * distance);
  const double bend = std::acos(std::clamp(cosine, -1.0, 1.0));
  const DVec3 knee = hip + thigh_m * (std::cos(bend) * down + std::sin(bend) * ahead);
  const DVec3 ankle = hip + distance * down;
  const DVec3 hinge = glm::cross(-down, ahead);
  return {FromAxes(hinge, (hip - knee) / thigh_m), FromAxes(hinge, (knee - ankle) / shank_m)};
}

}  // namespace

DQuat AboutX(double angle_rad) { return AboutAxis(angle_rad, 0); }
DQuat AboutY(double angle_rad) { return AboutAxis(angle_rad, 1); }
DQuat AboutZ(double angle_rad) { return AboutAxis(angle_rad, 2); }

double Ease(double u) {
  u = std::clamp(u, 0.0, 1.0);
  return u * u * u * (10.0 + u * (6.0 * u - 15.0));
}

int Figure::Parent(Part part) {
  return part == Part::kHips ? kNoParent : static_cast<int>(Spec(part).parent);
}

DVec3 Figure::Offset(Part part) const { return scale_ * Spec(part).offset_m; }

DVec3 Figure::End(Part part) const {
  switch (part) {
    case Part::kHead: return scale_ * DVec3(0.0, 0.20, 0.0);
    case Part::kLeftHand: return scale_ * DVec3(0.16, 0.0, 0.0);
    case Part::kRightHand: return scale_ * DVec3(-0.16, 0.0, 0.0);
    case Part::kLeftToes:
    case Part::kRightToes: return scale_ * DVec3(0.0, 0.0, 0.07);
    default: return DVec3(0.0);
  }
}

void FigurePose::HangArms(double swing_rad) {
  for (int side = 0; side < 2; ++side) {
    const double sign = side == 0 ? 1.0 : -1.0;
    ArmPose& pose = arms[static_cast<std::size_t>(side)];
    pose.arm = AboutX(sign * swing_rad) * AboutZ(-sign * 75.0 * kDegree);
    pose.forearm = AboutY(-sign * 15.0 * kDegree);
  }
}

std::array<DQuat, kPartCount> LocalRotations(const Figure& figure, const FigurePose& pose) {
  std::array<DQuat, kPartCount> local;
  local.fill(DQuat(1.0, 0.0, 0.0, 0.0));
  const auto at = [&](Part part) -> DQuat& { return local[static_cast<std::size_t>(part)]; };
  at(Part::kHips) = pose.pelvis;
  at(Part::kSpine) = pose.spine;
  at(Part::kChest) = pose.chest;
  at(Part::kHead) = pose.head;
  at(Part::kLeftArm) = pose.arms[0].arm;
  at(Part::kLeftForeArm) = pose.arms[0].forearm;
  at(Part::kRightArm) = pose.arms[1].arm;
  at(Part::kRightForeArm) = pose.arms[1].forearm;
  for (int side = 0; side < 2; ++side) {
    const Part up_leg = side == 0 ? Part::kLeftUpLeg : Part::kRightUpLeg;
    const auto first = static_cast<std::size_t>(up_leg);
    const FigurePose::LegPose& leg = pose.legs[static_cast<std::size_t>(side)];
    const DVec3 hip = pose.pelvis_m + pose.pelvis * figure.Offset(up_leg);
    const auto [thigh, shank] = BendLeg(hip, leg, figure.LegLength());
    local[first] = glm::conjugate(pose.pelvis) * thigh;
    local[first + 1] = glm::conjugate(thigh) * shank;
    local[first + 2] = glm::conjugate(shank) * leg.foot;
    local[first + 3] = AboutX(leg.toe_bend_rad);
  }
  return local;
}

}  // namespace stridewire::test
