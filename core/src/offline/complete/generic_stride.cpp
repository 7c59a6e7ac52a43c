#include "offline/complete/generic_stride.h"

#include <algorithm>
#include <numbers>

#include "base/trig.h"
#include "offline/build/pose_error.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step.h"

namespace stridewire::complete {
namespace {

// Stride length for the leg length of the generated figure.
constexpr double kStrideLengthM = 0.55;
constexpr double kArmSwingRad = 0.2;
// Minimum length of an upper arm. Collar bones and shoulder blades are shorter.
constexpr float kUpperArmM = 0.15f;

struct UpperArm {
  std::size_t joint = 0;  // The joint at the shoulder, which moves the upper arm.
  bool is_left = false;
};

// Returns the upper arm of each side: the first bone of the arm, from the trunk outward, that is at
// least kUpperArmM long. Returns fewer than two if the skeleton has no such bones.
std::vector<UpperArm> FindUpperArms(const Skeleton& skeleton, const Pose& stand) {
  const std::vector<BodyPart> parts = FindBodyParts(skeleton, stand);
  std::vector<Vec3> positions(skeleton.joints.size());
  std::vector<Quat> rotations(skeleton.joints.size());
  ForwardKinematics(skeleton, stand, positions, rotations);
  std::vector<UpperArm> arms;
  std::vector<bool> is_in_arm(skeleton.joints.size(), false);
  for (std::size_t j = 1; j < skeleton.joints.size(); ++j) {
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    is_in_arm[j] = is_in_arm[parent];
    if (is_in_arm[j] || parts[parent] != BodyPart::kArms) continue;
    if (glm::length(skeleton.joints[j].offset_m) < kUpperArmM) continue;
    arms.push_back({parent, positions[parent].x > positions[0].x});
    is_in_arm[j] = true;
  }
  return arms;
}

// Rotates an arm about the sideways axis of the body. Positive angles move it forward.
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

// Returns the root of a sample relative to the midpoint between the balls of the feet.
DVec3 RootFromBalls(const PostureSample& sample) {
  return sample.root_m - 0.5 * (sample.balls_m[0] + sample.balls_m[1]);
}

// Transfers poses of the generated figure to a person. Pelvis and feet of the person deviate from
// the person's stand pose as those of the figure deviate from its own stand pose. The deviations
// are scaled with the length of the legs.
class PoseTransfer {
 public:
  PoseTransfer(const Skeleton& figure, const PostureSample& stand, double scale)
      : figure_stand_(StandOfFigure(figure)), stand_(stand), scale_(scale) {}

  [[nodiscard]] PostureSample ToPerson(const PostureSample& from, Foot fixed) const {
    DVec3 origin = from.balls_m[static_cast<std::size_t>(fixed)];
    origin.y = 0.0;
    const DVec3 root = RootFromBalls(stand_);
    const DVec3 figure_root = RootFromBalls(figure_stand_);
    PostureSample to = stand_;
    to.root_m = scale_ * (from.root_m - origin);
    to.root_m.x += root.x - scale_ * figure_root.x;
    to.root_m.y = stand_.root_m.y + scale_ * (from.root_m.y - figure_stand_.root_m.y);
    to.root_m.z += root.z - scale_ * figure_root.z;
    to.rotations[0] =
        from.rotations[0] * glm::conjugate(figure_stand_.rotations[0]) * stand_.rotations[0];
    for (std::size_t f = 0; f < 2; ++f) {
      to.ankles[f] = from.ankles[f] * glm::conjugate(figure_stand_.ankles[f]) * stand_.ankles[f];
      to.balls_m[f] = scale_ * (from.balls_m[f] - origin);
      to.balls_m[f].y =
          stand_.balls_m[f].y + scale_ * (from.balls_m[f].y - figure_stand_.balls_m[f].y);
    }
    return to;
  }

 private:
  PostureSample figure_stand_;
  const PostureSample& stand_;
  double scale_;
};

}  // namespace

StrideModel GenericStride(const Skeleton& skeleton, const LegRig& rig, const PostureSample& stand,
                          Foot moving) {
  const Skeleton figure = builtin::MakeFigure();
  const RawExample example = builtin::MakeStep(
      figure, moving, builtin::StraightShape(moving, kStrideLengthM, kStrideLengthM), {}, "");
  const LegRig::Side& side = rig.side(moving);
  const double scale = (side.thigh_m + side.shank_m) / (builtin::kThighM + builtin::kShankM);
  const PoseTransfer transfer(figure, stand, scale);
  const std::vector<UpperArm> arms = FindUpperArms(skeleton, ToPose(stand));

  StrideModel model;
  for (std::size_t p = 0; p < kPointCount; ++p) {
    Pose pose(figure.joint_count());
    SampleClip(example.clip, TimeAtPoint(example.keytimes_s, p), pose);
    PostureSample& point = model.points.emplace_back(
        transfer.ToPerson(SampleOf(figure, pose, 0.0), OtherFoot(moving)));
    const double swing_rad = kArmSwingRad * Cos(std::numbers::pi * static_cast<double>(p) /
                                                static_cast<double>(kPointCount - 1));
    for (const UpperArm& arm : arms) {
      // The moving foot is behind at the start, so the arm of its side is in front.
      const bool is_on_moving_side = arm.is_left == (moving == Foot::kLeft);
      SwingArm(skeleton, arm, is_on_moving_side ? swing_rad : -swing_rad, point);
    }
  }
  std::ranges::copy(example.keytimes_s, model.keytimes_s.begin());
  model.start_length_m = model.end_length_m = scale * kStrideLengthM;
  model.width_m = scale * builtin::StandWidthM();
  return model;
}

}  // namespace stridewire::complete
