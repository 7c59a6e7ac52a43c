#include "offline/complete/generic_stride.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/trig.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step.h"
#include "offline/complete/upper_body_chains.h"

namespace stridewire::complete {
namespace {

// Length of the stride of the generated figure. It is scaled by the ratio of leg lengths.
constexpr double kStrideLengthM = 0.55;
constexpr double kArmSwingRad = 0.2;

// Positions and world rotations of the generated figure in a pose, in double precision.
struct FigureSample {
  PostureSample posture;
  std::array<DVec3, builtin::kFigureJointCount> positions_m{};
  std::array<DQuat, builtin::kFigureJointCount> rotations{};

  FigureSample(const Skeleton& figure, const Pose& pose) : posture(SampleOf(figure, pose, 0.0)) {
    std::vector<Vec3> positions(positions_m.size());
    std::vector<Quat> world(rotations.size());
    ForwardKinematics(figure, pose, positions, world);
    std::ranges::transform(positions, positions_m.begin(), [](const Vec3& p) { return DVec3(p); });
    std::ranges::transform(world, rotations.begin(), [](const Quat& q) { return DQuat(q); });
  }
  [[nodiscard]] DVec3 Hip(Foot foot) const {
    return positions_m[foot == Foot::kLeft ? builtin::kLeftUpLeg : builtin::kRightUpLeg];
  }
  [[nodiscard]] DVec3 Ankle(Foot foot) const {
    return positions_m[foot == Foot::kLeft ? builtin::kLeftFoot : builtin::kRightFoot];
  }
};

Pose StandOfFigure(const Skeleton& figure) {
  Pose pose(figure.joint_count());
  builtin::StorePose(builtin::StandingPose(), pose);
  return pose;
}

// Transfers poses of the generated figure to a person. Feet, pelvis, chest and head of the person
// deviate from the person's stand pose as those of the figure deviate from its own stand pose. The
// height of the hips is such that the leg of the fixed foot bends as far as the figure's. A person
// who crouches in the stand pose, for example to fight, therefore walks upright.
class PoseTransfer {
 public:
  PoseTransfer(const Skeleton& figure, const Skeleton& skeleton, const LegRig& rig,
               const PostureSample& stand, double scale)
      : figure_stand_(figure, StandOfFigure(figure)),
        skeleton_(skeleton),
        rig_(rig),
        chains_(FindUpperBodyChains(skeleton, stand)),
        stand_(LimitLean(skeleton, chains_, stand)),
        scale_(scale) {
    const Pose pose = ToPose(stand);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      LegPose leg;
      EvaluateLeg(skeleton, rig, pose, foot, leg);
      const auto ankle = static_cast<std::size_t>(rig.side(foot).ankle);
      ankle_to_ball_[static_cast<std::size_t>(foot)] =
          glm::conjugate(DQuat(leg.world_rotations[ankle])) *
          DVec3(leg.ball_m - leg.positions_m[ankle]);
    }
  }

  [[nodiscard]] PostureSample ToPerson(const FigureSample& from, Foot fixed) const {
    DVec3 origin = from.posture.balls_m[static_cast<std::size_t>(fixed)];
    origin.y = 0.0;
    PostureSample to = stand_;
    for (std::size_t f = 0; f < 2; ++f) {
      const PostureSample& figure = figure_stand_.posture;
      to.ankles[f] = from.posture.ankles[f] * glm::conjugate(figure.ankles[f]) * stand_.ankles[f];
      to.balls_m[f] = scale_ * (from.posture.balls_m[f] - origin);
      to.balls_m[f].y =
          stand_.balls_m[f].y + scale_ * (from.posture.balls_m[f].y - figure.balls_m[f].y);
      // Sideways, the ankles are as far apart as those of the figure, scaled to the person. Feet
      // that point further outward therefore have their balls further apart.
      const double ankle_x_m = scale_ * from.Ankle(static_cast<Foot>(f)).x;
      to.balls_m[f].x = ankle_x_m + (to.ankles[f] * ankle_to_ball_[f]).x;
    }
    const double fixed_x_m = to.balls_m[static_cast<std::size_t>(fixed)].x;
    for (DVec3& ball : to.balls_m) ball.x -= fixed_x_m;
    const auto deviation = [&](int joint) {
      const auto j = static_cast<std::size_t>(joint);
      return from.rotations[j] * glm::conjugate(figure_stand_.rotations[j]);
    };
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const LegRig::Side& side = rig_.side(foot);
      if (!side.has_toe_joint) continue;
      const auto f = static_cast<std::size_t>(foot);
      const auto toe = static_cast<std::size_t>(side.chain.back());
      const DQuat bend =
          deviation(foot == Foot::kLeft ? builtin::kLeftToeBase : builtin::kRightToeBase);
      to.rotations[toe] =
          glm::conjugate(to.ankles[f]) * bend * stand_.ankles[f] * stand_.rotations[toe];
    }
    TurnUpperBody(skeleton_, chains_, stand_,
                  {.pelvis = deviation(builtin::kHips),
                   .chest = deviation(builtin::kSpine1),
                   .head = deviation(builtin::kHead)},
                  to);
    PlaceRoot(from, fixed, to);
    return to;
  }

  // Swings both arms in opposite directions. A positive angle moves the arm on the moving foot's
  // side forward.
  void SwingArms(Foot moving, double forward_rad, PostureSample& sample) const {
    for (const UpperBodyChains::UpperArm& arm : chains_.upper_arms) {
      const bool is_on_moving_side = arm.is_left == (moving == Foot::kLeft);
      SwingArm(skeleton_, arm, is_on_moving_side ? forward_rad : -forward_rad, sample);
    }
  }

 private:
  void PlaceRoot(const FigureSample& from, Foot fixed, PostureSample& to) const {
    const auto f = static_cast<std::size_t>(fixed);
    PostureSample at_origin = to;
    at_origin.root_m = DVec3(0.0);
    const Pose pose = ToPose(at_origin);
    std::array<DVec3, 2> hips_m;  // [Foot]: relative to the root.
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      LegPose leg;
      EvaluateLeg(skeleton_, rig_, pose, foot, leg);
      hips_m[static_cast<std::size_t>(foot)] =
          DVec3(leg.positions_m[static_cast<std::size_t>(rig_.side(foot).hip)]);
    }
    const DVec3 middle = 0.5 * (hips_m[0] + hips_m[1]);
    const DVec3 ankle = to.balls_m[f] - to.ankles[f] * ankle_to_ball_[f];
    const DVec3 figure_middle = 0.5 * (from.Hip(Foot::kLeft) + from.Hip(Foot::kRight));
    to.root_m = ankle + scale_ * (figure_middle - from.Ankle(fixed)) - middle;

    const DVec3 figure_leg = from.Hip(fixed) - from.Ankle(fixed);
    const double extension =
        std::sqrt(glm::dot(figure_leg, figure_leg)) / (builtin::kThighM + builtin::kShankM);
    const LegRig::Side& side = rig_.side(fixed);
    const double reach_m = extension * (side.thigh_m + side.shank_m);
    const DVec3 leg = to.root_m + hips_m[f] - ankle;
    const double height_m =
        std::sqrt(std::max(0.0, reach_m * reach_m - leg.x * leg.x - leg.z * leg.z));
    to.root_m.y += height_m - leg.y;
  }

  FigureSample figure_stand_;
  const Skeleton& skeleton_;
  const LegRig& rig_;
  UpperBodyChains chains_;
  PostureSample stand_;
  double scale_;
  std::array<DVec3, 2> ankle_to_ball_{};  // [Foot]: in the frame of the ankle.
};

}  // namespace

StrideModel GenericStride(const Skeleton& skeleton, const LegRig& rig, const PostureSample& stand,
                          Foot moving) {
  const Skeleton figure = builtin::MakeFigure();
  const RawExample example = builtin::MakeStep(
      figure, moving, builtin::StraightShape(moving, kStrideLengthM, kStrideLengthM), {}, "");
  const LegRig::Side& side = rig.side(moving);
  const double scale = (side.thigh_m + side.shank_m) / (builtin::kThighM + builtin::kShankM);
  const PoseTransfer transfer(figure, skeleton, rig, stand, scale);

  StrideModel model;
  for (std::size_t p = 0; p < kPointCount; ++p) {
    Pose pose(figure.joint_count());
    SampleClip(example.clip, TimeAtPoint(example.keytimes_s, p), pose);
    PostureSample& point =
        model.points.emplace_back(transfer.ToPerson(FigureSample(figure, pose), OtherFoot(moving)));
    // The moving foot is behind at the start, so the arm of its side is in front.
    transfer.SwingArms(moving,
                       kArmSwingRad * Cos(std::numbers::pi * static_cast<double>(p) /
                                          static_cast<double>(kPointCount - 1)),
                       point);
  }
  std::ranges::copy(example.keytimes_s, model.keytimes_s.begin());
  model.start_length_m = model.end_length_m = scale * kStrideLengthM;
  const auto width_m = [&](const PostureSample& sample) {
    return std::fabs(sample.balls_m[0].x - sample.balls_m[1].x);
  };
  model.width_m = 0.5 * (width_m(model.points.front()) + width_m(model.points.back()));
  return model;
}

}  // namespace stridewire::complete
