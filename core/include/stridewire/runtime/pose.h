#pragma once

#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Borrowed pose: root translation and one local rotation a joint. rotations[0] is the root's, in
/// the frame the pose is meant in (the world, or a base frame); the others are relative to their
/// parent. The paper's posture with translations of the root only.
struct ConstPoseSpan {
  const Vec3& root_position_m;
  std::span<const Quat> rotations;
};

struct PoseSpan {
  Vec3& root_position_m;
  std::span<Quat> rotations;
  // NOLINTNEXTLINE(google-explicit-constructor): a view of a view.
  operator ConstPoseSpan() const { return {root_position_m, rotations}; }
};

/// Owned pose.
struct Pose {
  Vec3 root_position_m = Vec3(0.0f);
  std::vector<Quat> rotations;

  Pose() = default;
  explicit Pose(int joint_count)
      : rotations(static_cast<std::size_t>(joint_count), kIdentityQuat) {}
  operator PoseSpan() { return {root_position_m, rotations}; }             // NOLINT
  operator ConstPoseSpan() const { return {root_position_m, rotations}; }  // NOLINT
};

/// Joint positions and world rotations of a pose. `positions` and `world_rotations` hold one value
/// a joint. Never allocates.
void ForwardKinematics(const Skeleton& skeleton, ConstPoseSpan pose, std::span<Vec3> positions,
                       std::span<Quat> world_rotations);

/// World position of the ball of a foot. Walks up from the foot to the root; never allocates.
[[nodiscard]] Vec3 BallPosition(const Skeleton& skeleton, ConstPoseSpan pose, Foot foot);

/// World position of a point given in a joint's frame.
[[nodiscard]] Vec3 PointPosition(const Skeleton& skeleton, ConstPoseSpan pose, int joint,
                                 const Vec3& offset_m);

/// Pose arithmetic (paper, Section 5). Sums do not commute:
///   A + B = {t_A + t_B, r_B r_A},  A - B = {t_A - t_B, r_B^-1 r_A},  c A = {c t_A, slerp(1, r_A, c)}
/// so that (A - B) + B = A. All poses have the same number of joints; `out` may alias an input.
void Add(ConstPoseSpan a, ConstPoseSpan b, PoseSpan out);
void Subtract(ConstPoseSpan a, ConstPoseSpan b, PoseSpan out);
void Scale(float c, ConstPoseSpan a, PoseSpan out);

/// Largest angle between equal joints of two poses, radians.
[[nodiscard]] double LargestJointAngle(ConstPoseSpan a, ConstPoseSpan b);

}  // namespace stridewire
