#include "offline/complete/posture_mix.h"

namespace stridewire::complete {

PostureSample Blend(const PostureSample& a, const PostureSample& b, double share_of_b) {
  PostureSample out;
  Blend(a, b, share_of_b, out);
  return out;
}

void BlendFeet(const PostureSample& a, const PostureSample& b, double share_of_b,
               PostureSample& out) {
  const auto mix = [&](const DVec3& u, const DVec3& v) { return u + share_of_b * (v - u); };
  out.root_m = mix(a.root_m, b.root_m);
  for (std::size_t f = 0; f < 2; ++f) {
    out.ankles[f] = Blend(a.ankles[f], b.ankles[f], share_of_b);
    out.balls_m[f] = mix(a.balls_m[f], b.balls_m[f]);
  }
}

void Blend(const PostureSample& a, const PostureSample& b, double share_of_b, PostureSample& out) {
  BlendFeet(a, b, share_of_b, out);
  out.rotations.resize(a.rotations.size());
  for (std::size_t j = 0; j < a.rotations.size(); ++j) {
    out.rotations[j] = Blend(a.rotations[j], b.rotations[j], share_of_b);
  }
}

PostureSample SampleOf(const Skeleton& skeleton, ConstPoseSpan pose, double heading_rad) {
  const std::size_t joints = skeleton.joints.size();
  std::vector<Vec3> positions(joints);
  std::vector<Quat> world(joints);
  ForwardKinematics(skeleton, pose, positions, world);
  const DQuat to_heading(YawRotation(-heading_rad));
  PostureSample sample;
  sample.root_m = RotateYaw(-heading_rad, DVec3(pose.root_position_m));
  for (const Quat& rotation : pose.rotations) sample.rotations.emplace_back(rotation);
  sample.rotations[0] = to_heading * sample.rotations[0];
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    const auto ankle = static_cast<std::size_t>(skeleton.leg(foot).ankle);
    sample.ankles[f] = to_heading * DQuat(world[ankle]);
    sample.balls_m[f] = RotateYaw(-heading_rad, DVec3(BallPosition(skeleton, pose, foot)));
  }
  return sample;
}

DVec3 RootFromFeet(const PostureSample& sample) {
  DVec3 middle = 0.5 * (sample.balls_m[0] + sample.balls_m[1]);
  middle.y = 0.0;
  return sample.root_m - middle;
}

double LegLength(const Skeleton& skeleton, const LegRig& rig, const PostureSample& sample,
                 Foot foot) {
  const auto f = static_cast<std::size_t>(foot);
  const LegRig::Side& side = rig.side(foot);
  const auto ankle = static_cast<std::size_t>(side.ankle);
  LegPose leg;
  EvaluateLeg(skeleton, rig, ToPose(sample), foot, leg);
  const DVec3 ankle_to_ball =
      sample.ankles[f] * (glm::conjugate(DQuat(leg.world_rotations[ankle])) *
                          DVec3(leg.ball_m - leg.positions_m[ankle]));
  const DVec3 hip_m = sample.root_m + DVec3(leg.positions_m[static_cast<std::size_t>(side.hip)]);
  const DVec3 line = hip_m - (sample.balls_m[f] - ankle_to_ball);
  return std::sqrt(glm::dot(line, line));
}

Pose ToPose(const PostureSample& sample) {
  Pose pose(static_cast<int>(sample.rotations.size()));
  pose.root_position_m = Vec3(sample.root_m);
  for (std::size_t j = 0; j < sample.rotations.size(); ++j) {
    pose.rotations[j] = Normalise(Quat(sample.rotations[j]));
  }
  return pose;
}

}  // namespace stridewire::complete
