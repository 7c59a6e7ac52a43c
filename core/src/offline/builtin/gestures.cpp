#include "offline/builtin/gestures.h"

#include <cmath>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/trig.h"
#include "offline/builtin/figure.h"

namespace stridewire::builtin {
namespace {

constexpr double kFps = 60.0;
constexpr double kTwoPi = 6.283185307179586;

// Shoulder, upper arm, forearm and hand have successive indices. With identity rotations, arms
// point sideways.
std::size_t ShoulderOf(Foot side) { return side == Foot::kLeft ? kLeftShoulder : kRightShoulder; }

// Angles of an arm in radians: raised forwards (flexion) and sideways (abduction), rotated about
// its own axis, and bent at elbow and wrist. At outward_turn 0 the elbow bends forwards. A positive
// outward_turn makes it bend upwards. collar_lift raises the collar bone.
struct ArmAngles {
  double flexion = 0.0;
  double abduction = 0.0;
  double outward_turn = 0.0;
  double elbow = 0.0;
  double wrist = 0.0;
  double collar_lift = 0.0;
};

void SetArm(Foot side, const ArmAngles& arm, FigurePose& pose) {
  const double out = SideSign(side);
  const std::size_t shoulder = ShoulderOf(side);
  pose.rotations[shoulder] = RotateZ(out * arm.collar_lift);
  pose.rotations[shoulder + 1] = RotateX(-arm.flexion) *
                                 RotateZ(-out * (90.0 * kDegree - arm.abduction)) *
                                 RotateX(-arm.outward_turn);
  pose.rotations[shoulder + 2] = RotateY(-out * arm.elbow);
  pose.rotations[shoulder + 3] = RotateY(-out * arm.wrist);
}

// Returns the pose at `phase`, which increases from 0 to 1 over the loop. The forearm swings twice,
// and the hand lags behind it.
FigurePose Waving(double phase) {
  const double swing = Sin(2.0 * kTwoPi * phase);
  const double behind = Sin(2.0 * kTwoPi * phase - 0.9);
  FigurePose pose;
  SetArm(Foot::kRight,
         {.flexion = 24.0 * kDegree,
          .abduction = (50.0 + 4.0 * behind) * kDegree,
          .outward_turn = 62.0 * kDegree,
          .elbow = (118.0 + 24.0 * swing) * kDegree,
          .wrist = 14.0 * behind * kDegree,
          .collar_lift = 6.0 * kDegree},
         pose);
  return pose;
}

// Returns the pose at a phase of the loop. The forearms are level, the hands are apart by the width
// of a box, and the back leans backwards to balance the load. The figure breathes.
FigurePose Carrying(double phase) {
  const double breath = Sin(kTwoPi * phase);
  FigurePose pose;
  for (const std::size_t joint :
       {std::size_t{kLowerBack}, std::size_t{kSpine}, std::size_t{kSpine1}}) {
    pose.rotations[joint] = RotateX((-2.5 - 0.4 * breath) * kDegree);
  }
  for (const Foot side : {Foot::kLeft, Foot::kRight}) {
    SetArm(side,
           {.flexion = (16.0 + 0.8 * breath) * kDegree,
            .abduction = 10.0 * kDegree,
            .outward_turn = -28.0 * kDegree,
            .elbow = (76.0 + 1.5 * breath) * kDegree,
            .wrist = 6.0 * kDegree},
           pose);
  }
  return pose;
}

template <typename PoseAt>
RawLayer MakeLoop(const char* name, double duration_s, PoseAt pose_at) {
  const int frames = static_cast<int>(std::lround(duration_s * kFps));
  STRIDEWIRE_CHECK(frames > 0);
  RawLayer layer;
  layer.name = name;
  layer.source = std::string("generated ") + name;
  layer.clip.fps = kFps;
  layer.clip.Resize(frames + 1, kFigureJointCount);
  for (int f = 0; f <= frames; ++f) {
    StorePose(pose_at(static_cast<double>(f % frames) / frames), layer.clip.frame(f));
  }
  layer.weights.assign(kFigureJointCount, 0.0f);
  return layer;
}

void IncludeArm(Foot side, RawLayer& layer) {
  for (std::size_t i = 0; i < 4; ++i) layer.weights[ShoulderOf(side) + i] = 1.0f;
}

}  // namespace

void AddGestures(RawLibrary& library) {
  RawLayer wave = MakeLoop("wave", 1.2, Waving);
  IncludeArm(Foot::kRight, wave);
  library.layers.push_back(std::move(wave));

  RawLayer carry = MakeLoop("carry", 3.0, Carrying);
  IncludeArm(Foot::kLeft, carry);
  IncludeArm(Foot::kRight, carry);
  // The weights of the spine blend from the motion of the legs below it to that of the load above
  // it.
  carry.weights[kLowerBack] = 0.25f;
  carry.weights[kSpine] = 0.5f;
  carry.weights[kSpine1] = 0.75f;
  library.layers.push_back(std::move(carry));
}

}  // namespace stridewire::builtin
