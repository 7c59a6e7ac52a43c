#include "offline/builtin/mirror.h"

#include <algorithm>

#include "base/check.h"
#include "offline/builtin/figure.h"

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

RawExample Mirrored(const RawExample& example, std::span<const ParameterName> names) {
  STRIDEWIRE_CHECK(names.size() == example.parameters.size());
  STRIDEWIRE_CHECK(example.clip.joint_count == kFigureJointCount);
  RawExample mirrored = example;
  mirrored.mirrored = !example.mirrored;
  mirrored.heading_change_rad = -example.heading_change_rad;
  for (std::size_t l = 0; l < names.size(); ++l) {
    const ParameterName name = names[l];
    if (name == ParameterName::kStartX || name == ParameterName::kEndX ||
        name == ParameterName::kTurn) {
      mirrored.parameters[l] = -example.parameters[l];
    }
  }
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

RawExample Reversed(const RawExample& example, double slowdown) {
  STRIDEWIRE_CHECK(example.parameters.size() == 2 && example.heading_change_rad == 0.0);
  RawExample reversed = example;
  const double end_s = slowdown * example.keytimes_s.back();
  const std::size_t keys = example.keytimes_s.size();
  for (std::size_t k = 0; k < keys; ++k) {
    reversed.keytimes_s[k] = end_s - slowdown * example.keytimes_s[keys - 1 - k];
  }
  reversed.clip.fps = example.clip.fps / slowdown;
  const int last = example.clip.frame_count() - 1;
  const Vec3 start = example.clip.frame(last).root_position_m;
  for (int f = 0; f <= last; ++f) {
    const ConstPoseSpan from = example.clip.frame(last - f);
    const PoseSpan to = reversed.clip.frame(f);
    to.root_position_m = from.root_position_m - Vec3(start.x, 0.0f, start.z);
    std::copy(from.rotations.begin(), from.rotations.end(), to.rotations.begin());
  }
  reversed.parameters = {example.parameters[1], example.parameters[0]};
  return reversed;
}

}  // namespace stridewire::builtin
