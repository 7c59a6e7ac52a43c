#include "offline/builtin/upper_body.h"

namespace stridewire::builtin {
namespace {

// Upper arms are rotated inwards, so that bent elbows bring the hands in front of the body.
constexpr double kInwardTurnRad = 18.0 * kDegree;

DQuat YawRollLean(double yaw, double roll, double lean) {
  return RotateY(yaw) * RotateZ(roll) * RotateX(lean);
}

}  // namespace

void SetUpperBody(const UpperBody& body, double pelvis_yaw, double pelvis_roll, double pelvis_tilt,
                  FigurePose& pose) {
  const DQuat third =
      YawRollLean((body.thorax_yaw - pelvis_yaw) / 3.0, (body.thorax_roll - pelvis_roll) / 3.0,
                  (body.thorax_lean - pelvis_tilt) / 3.0);
  pose.rotations[kLowerBack] = third;
  pose.rotations[kSpine] = third;
  pose.rotations[kSpine1] = third;
  const DQuat neck = YawRollLean((body.head_yaw - body.thorax_yaw) / 3.0, -body.thorax_roll / 3.0,
                                 (body.head_nod - body.thorax_lean) / 3.0);
  pose.rotations[kNeck] = neck;
  pose.rotations[kNeck1] = neck;
  pose.rotations[kHead] = neck;
  for (const Foot side : {Foot::kLeft, Foot::kRight}) {
    const auto s = static_cast<std::size_t>(side);
    const double out = SideSign(side);
    const std::size_t shoulder = side == Foot::kLeft ? kLeftShoulder : kRightShoulder;
    // The collar bone slightly follows the arm. The arms hang down, whereas in the T-pose they
    // point sideways.
    pose.rotations[shoulder] = RotateY(-out * 0.12 * body.arm_flexion[s]);
    pose.rotations[shoulder + 1] = RotateX(-body.arm_flexion[s]) *
                                   RotateZ(-out * (90.0 * kDegree - body.arm_abduction)) *
                                   RotateX(kInwardTurnRad);
    pose.rotations[shoulder + 2] = RotateY(-out * body.elbow_flexion[s]);
    pose.rotations[shoulder + 3] = RotateY(-out * (4.0 * kDegree + 0.15 * body.elbow_flexion[s]));
  }
}

}  // namespace stridewire::builtin
