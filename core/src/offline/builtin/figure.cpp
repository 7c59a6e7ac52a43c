#include "offline/builtin/figure.h"

#include "base/check.h"
#include "base/trig.h"

namespace stridewire::builtin {
namespace {

struct JointRow {
  const char* name;
  int parent;
  double x, y, z;  // Position in the frame of the parent, in metres.
};

constexpr double kShoulderOutM = 0.13 * kStatureM;
constexpr double kUpperArmM = 0.186 * kStatureM;
constexpr double kForeArmM = 0.146 * kStatureM;
constexpr double kHandM = 0.108 * kStatureM;

constexpr JointRow kRows[kFigureJointCount] = {
    {"Hips", -1, 0.0, 0.0, 0.0},
    {"LeftUpLeg", kHips, kHipHalfWidthM, 0.0, 0.0},
    {"LeftLeg", kLeftUpLeg, 0.0, -kThighM, 0.0},
    {"LeftFoot", kLeftLeg, 0.0, -kShankM, 0.0},
    {"LeftToeBase", kLeftFoot, 0.0, -kAnkleHeightM, kBallAheadOfAnkleM},
    {"RightUpLeg", kHips, -kHipHalfWidthM, 0.0, 0.0},
    {"RightLeg", kRightUpLeg, 0.0, -kThighM, 0.0},
    {"RightFoot", kRightLeg, 0.0, -kShankM, 0.0},
    {"RightToeBase", kRightFoot, 0.0, -kAnkleHeightM, kBallAheadOfAnkleM},
    {"LowerBack", kHips, 0.0, 0.07, -0.02},
    {"Spine", kLowerBack, 0.0, 0.11, 0.0},
    {"Spine1", kSpine, 0.0, 0.12, -0.005},
    {"Neck", kSpine1, 0.0, 0.215, 0.0},
    {"Neck1", kNeck, 0.0, 0.05, 0.008},
    {"Head", kNeck1, 0.0, 0.05, 0.012},
    {"LeftShoulder", kSpine1, 0.02, 0.175, 0.0},
    {"LeftArm", kLeftShoulder, kShoulderOutM - 0.02, 0.02, 0.0},
    {"LeftForeArm", kLeftArm, kUpperArmM, 0.0, 0.0},
    {"LeftHand", kLeftForeArm, kForeArmM, 0.0, 0.0},
    {"RightShoulder", kSpine1, -0.02, 0.175, 0.0},
    {"RightArm", kRightShoulder, -(kShoulderOutM - 0.02), 0.02, 0.0},
    {"RightForeArm", kRightArm, -kUpperArmM, 0.0, 0.0},
    {"RightHand", kRightForeArm, -kForeArmM, 0.0, 0.0},
};

}  // namespace

Skeleton MakeFigure() {
  Skeleton figure;
  for (const JointRow& row : kRows) {
    figure.joints.push_back({row.name, row.parent, Vec3(row.x, row.y, row.z)});
  }
  const Vec3 toe_tip(0.0f, 0.0f, static_cast<float>(kToeM));
  figure.end_sites = {{kLeftToeBase, toe_tip},
                      {kRightToeBase, toe_tip},
                      {kHead, Vec3(0.0f, 0.19f, 0.0f)},
                      {kLeftHand, Vec3(static_cast<float>(kHandM), 0.0f, 0.0f)},
                      {kRightHand, Vec3(static_cast<float>(-kHandM), 0.0f, 0.0f)}};
  figure.legs[0] = {kLeftUpLeg, kLeftLeg, kLeftFoot, kLeftToeBase, Vec3(0.0f), toe_tip};
  figure.legs[1] = {kRightUpLeg, kRightLeg, kRightFoot, kRightToeBase, Vec3(0.0f), toe_tip};
  STRIDEWIRE_CHECK(figure.joint_count() == kFigureJointCount);
  return figure;
}

DQuat RotateX(double angle_rad) {
  return DQuat(Cos(0.5 * angle_rad), Sin(0.5 * angle_rad), 0.0, 0.0);
}
DQuat RotateY(double angle_rad) {
  return DQuat(Cos(0.5 * angle_rad), 0.0, Sin(0.5 * angle_rad), 0.0);
}
DQuat RotateZ(double angle_rad) {
  return DQuat(Cos(0.5 * angle_rad), 0.0, 0.0, Sin(0.5 * angle_rad));
}

FigurePoints PointsOf(const Skeleton& figure, const FigurePose& pose) {
  FigurePoints points;
  for (std::size_t j = 0; j < kFigureJointCount; ++j) {
    const int parent = figure.joints[j].parent;
    if (parent < 0) {
      points.rotations[j] = pose.rotations[j];
      points.positions_m[j] = pose.root_m;
      continue;
    }
    const auto p = static_cast<std::size_t>(parent);
    points.rotations[j] = points.rotations[p] * pose.rotations[j];
    points.positions_m[j] =
        points.positions_m[p] + points.rotations[p] * DVec3(figure.joints[j].offset_m);
  }
  return points;
}

DVec3 BodyCentre(const Skeleton& figure, const FigurePose& pose) {
  const FigurePoints points = PointsOf(figure, pose);
  const auto between = [&](int from, int to, double fraction) {
    const DVec3& a = points.positions_m[static_cast<std::size_t>(from)];
    const DVec3& b = points.positions_m[static_cast<std::size_t>(to)];
    return a + fraction * (b - a);
  };
  const auto beyond = [&](int joint, const DVec3& offset) {
    const auto j = static_cast<std::size_t>(joint);
    return points.positions_m[j] + points.rotations[j] * offset;
  };
  DVec3 sum = 0.497 * between(kHips, kNeck, 0.5) + 0.081 * beyond(kHead, DVec3(0.0, 0.06, 0.01));
  for (const int side : {0, 1}) {
    const int leg = side == 0 ? kLeftUpLeg : kRightUpLeg;
    const int arm = side == 0 ? kLeftArm : kRightArm;
    const double out = side == 0 ? 1.0 : -1.0;
    sum += 0.100 * between(leg, leg + 1, 0.433) + 0.0465 * between(leg + 1, leg + 2, 0.433) +
           0.0145 * between(leg + 2, leg + 3, 0.5) + 0.028 * between(arm, arm + 1, 0.436) +
           0.016 * between(arm + 1, arm + 2, 0.430) +
           0.006 * beyond(arm + 2, DVec3(out * 0.5 * kHandM, 0.0, 0.0));
  }
  return sum;
}

void StorePose(const FigurePose& pose, PoseSpan out) {
  STRIDEWIRE_CHECK(out.rotations.size() == kFigureJointCount);
  out.root_position_m = Vec3(pose.root_m);
  for (std::size_t j = 0; j < kFigureJointCount; ++j) {
    out.rotations[j] = Normalise(Quat(pose.rotations[j]));
  }
}

}  // namespace stridewire::builtin
