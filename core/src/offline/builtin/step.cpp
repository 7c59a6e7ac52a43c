#include "offline/builtin/step.h"

#include <cmath>
#include <string>
#include <utility>

#include "offline/builtin/curve.h"
#include "offline/builtin/elementary.h"
#include "offline/builtin/foot_path.h"
#include "offline/builtin/leg_ik.h"
#include "offline/builtin/pelvis_path.h"
#include "offline/builtin/step_timing.h"
#include "offline/builtin/upper_body.h"

namespace stridewire::builtin {
namespace {

constexpr double kArmAbductionRad = 6.0 * kDegree;
constexpr double kStandingElbowRad = 14.0 * kDegree;
constexpr double kStandingArmRad = -1.0 * kDegree;

double Mix(double a, double b, double s) { return a + (b - a) * s; }

// Perry and Burnfield: the shoulder moves between 24 degrees of extension and 8 of flexion, the
// elbow between 20 and 45 degrees.
double ArmForward(double vigour) { return Mix(kStandingArmRad, 10.0 * kDegree, vigour); }
double ArmBack(double vigour) { return Mix(kStandingArmRad, -24.0 * kDegree, vigour); }
double ElbowForward(double vigour) { return Mix(kStandingElbowRad, 42.0 * kDegree, vigour); }
double ElbowBack(double vigour) { return Mix(kStandingElbowRad, 20.0 * kDegree, vigour); }
double Lean(const GaitState& state) { return (2.0 + 2.0 * state.speed_mps) * kDegree; }

/// Curves of all joints above the pelvis over a step.
struct UpperBodyPath {
  Curve thorax_yaw, thorax_roll, lean, arm_with_moving, arm_with_fixed, elbow_with_moving,
      elbow_with_fixed;

  UpperBodyPath(Foot moving, const StepTiming& timing)
      : thorax_yaw(Swing(timing, -SideSign(moving) * 4.0 * kDegree * timing.start.vigour,
                         SideSign(moving) * 4.0 * kDegree * timing.end.vigour)),
        thorax_roll({{0.0, 0.0, 0.0},
                     {0.5 * (timing.toe_off_s + timing.heel_strike_s),
                      SideSign(moving) * 1.0 * kDegree, 0.0},
                     {timing.end_s, 0.0, 0.0}}),
        lean(Swing(timing, Lean(timing.start), Lean(timing.end))),
        // The moving foot is behind at the start, so the arm of its side is in front.
        arm_with_moving(Swing(timing, ArmForward(timing.start.vigour), ArmBack(timing.end.vigour))),
        arm_with_fixed(Swing(timing, ArmBack(timing.start.vigour), ArmForward(timing.end.vigour))),
        elbow_with_moving(
            Swing(timing, ElbowForward(timing.start.vigour), ElbowBack(timing.end.vigour))),
        elbow_with_fixed(
            Swing(timing, ElbowBack(timing.start.vigour), ElbowForward(timing.end.vigour))) {}

  static Curve Swing(const StepTiming& timing, double from, double to) {
    return Curve({{0.0, from, 0.0}, {timing.end_s, to, 0.0}});
  }

  [[nodiscard]] UpperBody At(Foot moving, double time_s) const {
    UpperBody body;
    body.thorax_yaw = thorax_yaw.At(time_s);
    body.thorax_roll = thorax_roll.At(time_s);
    body.thorax_lean = lean.At(time_s);
    body.head_nod = 0.3 * body.thorax_lean;
    body.arm_abduction = kArmAbductionRad;
    const auto m = static_cast<std::size_t>(moving),
               f = static_cast<std::size_t>(OtherFoot(moving));
    body.arm_flexion[m] = arm_with_moving.At(time_s);
    body.arm_flexion[f] = arm_with_fixed.At(time_s);
    body.elbow_flexion[m] = elbow_with_moving.At(time_s);
    body.elbow_flexion[f] = elbow_with_fixed.At(time_s);
    return body;
  }
};

constexpr double kHeadLeadS = 0.25;

double ParameterOf(const StepShape& shape, ParameterName name) {
  switch (name) {
    case ParameterName::kStartX: return shape.start_m.x;
    case ParameterName::kStartY: return shape.start_m.y;
    case ParameterName::kStartZ: return shape.start_m.z;
    case ParameterName::kEndX: return shape.end_m.x;
    case ParameterName::kEndY: return shape.end_m.y;
    case ParameterName::kEndZ: return shape.end_m.z;
    case ParameterName::kTurn: return shape.turn_rad;
    case ParameterName::kLength:
    case ParameterName::kHeight: break;
  }
  return 0.0;
}

}  // namespace

UpperBody StandingUpperBody() {
  UpperBody body;
  body.thorax_lean = Lean(MakeGaitState(0.0));
  body.head_nod = 0.3 * body.thorax_lean;
  body.arm_abduction = kArmAbductionRad;
  for (const std::size_t side : {0u, 1u}) {
    body.arm_flexion[side] = kStandingArmRad;
    body.elbow_flexion[side] = kStandingElbowRad;
  }
  return body;
}

FigurePose StandingPose() {
  FigurePose pose;
  const GaitState still = MakeGaitState(0.0);
  pose.root_m = DVec3(0.0, kStandingHipHeightM, 0.0);
  SetUpperBody(StandingUpperBody(), 0.0, 0.0, 0.0, pose);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const DVec3 ball = StandingBall(foot) - DVec3(0.0, 0.0, still.pelvis_ahead_m);
    SolveLeg(foot, FootOnGround(foot, ball, 0.0, 0.0), pose);
  }
  return pose;
}

double NaturalSide() { return 2.0 * StandingBall(Foot::kLeft).x; }

StepShape StraightShape(Foot moving, double start_length_m, double end_length_m) {
  StepShape shape;
  shape.start_m = DVec3(SideSign(moving) * NaturalSide(), 0.0, -start_length_m);
  shape.end_m = DVec3(SideSign(moving) * NaturalSide(), 0.0, end_length_m);
  return shape;
}

RawExample MakeStep(const Skeleton& figure, Foot moving, const StepShape& shape,
                    std::span<const ParameterName> names, std::string source) {
  const StepTiming timing = MakeStepTiming(shape);
  const FootPaths feet(moving, timing);
  const PelvisPath pelvis(moving, timing, feet);
  const UpperBodyPath upper(moving, timing);

  RawExample example;
  example.keytimes_s = timing.keytimes_s();
  for (const ParameterName name : names) example.parameters.push_back(ParameterOf(shape, name));
  example.heading_change_rad = shape.turn_rad;
  example.source = std::move(source);
  example.clip.fps = kClipFps;
  const int frames = static_cast<int>(std::floor(timing.end_s * kClipFps + 0.5)) + 1;
  example.clip.Resize(frames, figure.joint_count());
  const DVec3 start = pelvis.Position(0.0);
  for (int f = 0; f < frames; ++f) {
    const double time_s = f / kClipFps;
    const double heading = pelvis.Heading(time_s);
    FigurePose pose;
    pose.root_m = pelvis.Position(time_s);
    pose.rotations[kHips] = pelvis.Rotation(time_s);
    UpperBody body = upper.At(moving, time_s);
    // People look in the direction in which they are about to walk.
    body.head_yaw = (pelvis.Heading(time_s + kHeadLeadS) - heading) * Ease(time_s / 0.2);
    SetUpperBody(body, pelvis.Yaw(time_s), pelvis.Roll(time_s), pelvis.Tilt(time_s), pose);
    SolveLeg(moving, feet.Moving(time_s), pose, heading);
    SolveLeg(OtherFoot(moving), feet.Fixed(time_s), pose, heading);
    pose.root_m -= DVec3(start.x, 0.0, start.z);
    StorePose(pose, example.clip.frame(f));
  }
  return example;
}

}  // namespace stridewire::builtin
