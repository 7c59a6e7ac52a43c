#include "offline/builtin/step.h"

#include <cmath>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/easing.h"
#include "offline/builtin/foot_path.h"
#include "offline/builtin/leg_ik.h"
#include "offline/builtin/pelvis_path.h"
#include "offline/builtin/step_timing.h"
#include "offline/builtin/upper_body_path.h"
#include "runtime/weights/end_measures.h"

namespace stridewire::builtin {
namespace {

constexpr double kHeadLeadS = 0.25;

}  // namespace

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

double StandWidthM() { return 2.0 * StandingBall(Foot::kLeft).x; }

StepShape StraightShape(Foot moving, double start_length_m, double end_length_m) {
  StepShape shape;
  shape.start_m = DVec3(SideSign(moving) * StandWidthM(), 0.0, -start_length_m);
  shape.end_m = DVec3(SideSign(moving) * StandWidthM(), 0.0, end_length_m);
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
  const EndMeasures ends = {
      .start_m = shape.start_m, .end_m = shape.end_m, .heading_change_rad = shape.turn_rad};
  for (const ParameterName name : names) example.parameters.push_back(ParameterOf(ends, name));
  example.heading_change_rad = shape.turn_rad;
  example.source = std::move(source);
  example.clip.fps = kClipFps;
  const int frames = static_cast<int>(std::floor(timing.end_s * kClipFps + 0.5)) + 1;
  STRIDEWIRE_CHECK(frames > 1 && example.parameters.size() == names.size());
  example.clip.Resize(frames, figure.joint_count());
  const DVec3 start = pelvis.Position(0.0);
  for (int f = 0; f < frames; ++f) {
    const double time_s = f / kClipFps;
    const double heading = pelvis.Heading(time_s);
    FigurePose pose;
    pose.root_m = pelvis.Position(time_s);
    pose.rotations[kHips] = pelvis.Rotation(time_s);
    UpperBody body = upper.At(time_s);
    // People look in the direction in which they are about to walk.
    body.head_yaw = (pelvis.Heading(time_s + kHeadLeadS) - heading) * SmoothStep(time_s / 0.2);
    SetUpperBody(body, pelvis.Yaw(time_s), pelvis.Roll(time_s), pelvis.Tilt(time_s), pose);
    SolveLeg(moving, feet.Moving(time_s), pose, heading);
    SolveLeg(OtherFoot(moving), feet.Fixed(time_s), pose, heading);
    pose.root_m -= DVec3(start.x, 0.0, start.z);
    StorePose(pose, example.clip.frame(f));
  }
  return example;
}

}  // namespace stridewire::builtin
