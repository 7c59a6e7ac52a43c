#include "stridewire/runtime/pose.h"

#include <algorithm>

namespace stridewire {

void ForwardKinematics(const Skeleton& skeleton, ConstPoseSpan pose, std::span<Vec3> positions,
                       std::span<Quat> world_rotations) {
  positions[0] = pose.root_position_m;
  world_rotations[0] = pose.rotations[0];
  for (std::size_t j = 1; j < skeleton.joints.size(); ++j) {
    const Joint& joint = skeleton.joints[j];
    const auto parent = static_cast<std::size_t>(joint.parent);
    positions[j] = positions[parent] + world_rotations[parent] * joint.offset_m;
    world_rotations[j] = world_rotations[parent] * pose.rotations[j];
  }
}

Vec3 PointPosition(const Skeleton& skeleton, ConstPoseSpan pose, int joint, const Vec3& offset_m) {
  Vec3 point = offset_m;
  for (int j = joint; j > 0; j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
    point = skeleton.joints[static_cast<std::size_t>(j)].offset_m +
            pose.rotations[static_cast<std::size_t>(j)] * point;
  }
  return pose.root_position_m + pose.rotations[0] * point;
}

Vec3 BallPosition(const Skeleton& skeleton, ConstPoseSpan pose, Foot foot) {
  const Leg& leg = skeleton.leg(foot);
  return PointPosition(skeleton, pose, leg.ball, leg.ball_offset_m);
}

void Add(ConstPoseSpan a, ConstPoseSpan b, PoseSpan out) {
  out.root_position_m = a.root_position_m + b.root_position_m;
  for (std::size_t j = 0; j < out.rotations.size(); ++j) {
    out.rotations[j] = b.rotations[j] * a.rotations[j];
  }
}

void Subtract(ConstPoseSpan a, ConstPoseSpan b, PoseSpan out) {
  out.root_position_m = a.root_position_m - b.root_position_m;
  for (std::size_t j = 0; j < out.rotations.size(); ++j) {
    out.rotations[j] = glm::conjugate(b.rotations[j]) * a.rotations[j];
  }
}

void Scale(float c, ConstPoseSpan a, PoseSpan out) {
  out.root_position_m = c * a.root_position_m;
  for (std::size_t j = 0; j < out.rotations.size(); ++j) {
    out.rotations[j] = SlerpFromIdentity(a.rotations[j], c);
  }
}

double LargestJointAngle(ConstPoseSpan a, ConstPoseSpan b) {
  double largest = 0.0;
  for (std::size_t j = 0; j < a.rotations.size(); ++j) {
    largest = std::max(largest, AngleBetween(a.rotations[j], b.rotations[j]));
  }
  return largest;
}

}  // namespace stridewire
