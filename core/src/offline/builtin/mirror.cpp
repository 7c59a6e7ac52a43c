#include "mirror.h"

#include "figure.h"

namespace stridewire::builtin {
namespace {

int OtherSide(int joint) {
  if (joint >= kLeftUpLeg && joint <= kLeftToeBase) return joint + (kRightUpLeg - kLeftUpLeg);
  if (joint >= kRightUpLeg && joint <= kRightToeBase) return joint - (kRightUpLeg - kLeftUpLeg);
  if (joint >= kLeftShoulder && joint <= kLeftHand) return joint + (kRightShoulder - kLeftShoulder);
  if (joint >= kRightShoulder) return joint - (kRightShoulder - kLeftShoulder);
  return joint;
}

}  // namespace

RawExample Mirrored(const RawExample& example) {
  RawExample mirrored = example;
  mirrored.mirrored = !example.mirrored;
  mirrored.heading_change_rad = -example.heading_change_rad;
  for (int f = 0; f < example.clip.frame_count(); ++f) {
    const ConstPoseSpan from = example.clip.frame(f);
    PoseSpan to = mirrored.clip.frame(f);
    to.root_position_m.x = -from.root_position_m.x;
    for (int j = 0; j < kFigureJointCount; ++j) {
      const Quat& q = from.rotations[static_cast<std::size_t>(j)];
      to.rotations[static_cast<std::size_t>(OtherSide(j))] = Quat(q.w, q.x, -q.y, -q.z);
    }
  }
  return mirrored;
}

}  // namespace stridewire::builtin
