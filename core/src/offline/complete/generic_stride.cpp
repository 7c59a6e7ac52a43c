#include "offline/complete/generic_stride.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/trig.h"
#include "offline/build/pose_error.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step.h"

namespace stridewire::complete {
namespace {

constexpr double kGenericLengthM = 0.55;  // Of the generated figure.
constexpr double kArmSwingRad = 0.2;
// The first joint of an arm with a longer bone below it is the upper arm.
constexpr float kUpperArmM = 0.15f;
constexpr double kPi = 3.14159265358979323846;

struct UpperArm {
  std::size_t joint = 0;
  bool is_left = false;
};

// Returns the upper arms of a skeleton, as far as they can be found.
std::vector<UpperArm> FindUpperArms(const Skeleton& skeleton, const Pose& stand) {
  const std::vector<BodyPart> parts = FindBodyParts(skeleton, stand);
  std::vector<Vec3> positions(skeleton.joints.size());
  std::vector<Quat> rotations(skeleton.joints.size());
  ForwardKinematics(skeleton, stand, positions, rotations);
  std::vector<UpperArm> arms;
  std::vector<bool> is_below(skeleton.joints.size(), false);
  for (std::size_t j = 1; j < skeleton.joints.size(); ++j) {
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    is_below[j] = is_below[parent];
    if (is_below[j] || parts[parent] != BodyPart::kArms) continue;
    if (glm::length(skeleton.joints[j].offset_m) < kUpperArmM) continue;
    arms.push_back({parent, positions[parent].x > positions[0].x});
    is_below[j] = true;
  }
  return arms;
}

// Turns an arm about the axis that points to the left. Positive angles move it forward.
void SwingArm(const Skeleton& skeleton, const UpperArm& arm, double forward_rad,
              PostureSample& sample) {
  DQuat above(1.0, 0.0, 0.0, 0.0);
  for (int j = skeleton.joints[arm.joint].parent; j >= 0;
       j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
    above = sample.rotations[static_cast<std::size_t>(j)] * above;
  }
  DQuat& rotation = sample.rotations[arm.joint];
  rotation = glm::conjugate(above) * builtin::RotateX(-forward_rad) * above * rotation;
}

PostureSample StandOfFigure(const Skeleton& figure) {
  Pose pose(figure.joint_count());
  builtin::StorePose(builtin::StandingPose(), pose);
  return SampleOf(figure, pose, 0.0);
}

}  // namespace

StrideModel GenericStride(const Skeleton& skeleton, const LegRig& rig, const PostureSample& stand,
                          Foot moving) {
  const Skeleton figure = builtin::MakeFigure();
  const PostureSample figure_stand = StandOfFigure(figure);
  const RawExample example = builtin::MakeStep(
      figure, moving, builtin::StraightShape(moving, kGenericLengthM, kGenericLengthM), {}, "");
  const LegRig::Side& side = rig.side(moving);
  const double scale = (side.thigh_m + side.shank_m) / (builtin::kThighM + builtin::kShankM);
  const auto fixed = static_cast<std::size_t>(OtherFoot(moving));
  const DVec3 stand_root = stand.root_m - 0.5 * (stand.balls_m[0] + stand.balls_m[1]);
  const DVec3 figure_root =
      figure_stand.root_m - 0.5 * (figure_stand.balls_m[0] + figure_stand.balls_m[1]);
  const std::vector<UpperArm> arms = FindUpperArms(skeleton, ToPose(stand));

  StrideModel model;
  for (std::size_t p = 0; p < kPointCount; ++p) {
    Pose pose(figure.joint_count());
    SampleClip(example.clip, TimeAtPoint(example.keytimes_s, p), pose);
    PostureSample from = SampleOf(figure, pose, 0.0);
    DVec3 origin = from.balls_m[fixed];
    origin.y = 0.0;
    PostureSample& point = model.points.emplace_back(stand);
    point.root_m = scale * (from.root_m - origin);
    point.root_m.x += stand_root.x - scale * figure_root.x;
    point.root_m.y = stand.root_m.y + scale * (from.root_m.y - figure_stand.root_m.y);
    point.root_m.z += stand_root.z - scale * figure_root.z;
    point.rotations[0] =
        from.rotations[0] * glm::conjugate(figure_stand.rotations[0]) * stand.rotations[0];
    for (std::size_t f = 0; f < 2; ++f) {
      point.ankles[f] = from.ankles[f] * glm::conjugate(figure_stand.ankles[f]) * stand.ankles[f];
      point.balls_m[f] = scale * (from.balls_m[f] - origin);
      point.balls_m[f].y =
          stand.balls_m[f].y + scale * (from.balls_m[f].y - figure_stand.balls_m[f].y);
    }
    const double swing =
        kArmSwingRad * Cos(kPi * static_cast<double>(p) / static_cast<double>(kPointCount - 1));
    for (const UpperArm& arm : arms) {
      // The moving foot is behind at the start, so the arm of its side is in front.
      const bool is_with_moving = arm.is_left == (moving == Foot::kLeft);
      SwingArm(skeleton, arm, is_with_moving ? swing : -swing, point);
    }
  }
  std::ranges::copy(example.keytimes_s, model.keytimes_s.begin());
  model.start_length_m = model.end_length_m = scale * kGenericLengthM;
  model.width_m = scale * builtin::NaturalSide();
  return model;
}

}  // namespace stridewire::complete
