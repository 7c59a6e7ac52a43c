#pragma once

#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Borrowed pose: the position of the root and one rotation per joint. rotations[0] is the rotation
/// of the root, relative to the world or to a base frame. The others are relative to the parent
/// joint. The paper calls this a posture. Only the root has a translation.
struct ConstPoseSpan {
  const Vec3& root_position_m;
  std::span<const Quat> rotations;
};

struct PoseSpan {
  Vec3& root_position_m;
  std::span<Quat> rotations;
  // NOLINTNEXTLINE(google-explicit-constructor): PoseSpan is used where ConstPoseSpan is expected.
  operator ConstPoseSpan() const { return {root_position_m, rotations}; }
};

/// A pose that owns its rotations.
struct Pose {
  Vec3 root_position_m = Vec3(0.0f);
  std::vector<Quat> rotations;

  Pose() = default;
  explicit Pose(int joint_count)
      : rotations(static_cast<std::size_t>(joint_count), kIdentityQuat) {}
  operator PoseSpan() { return {root_position_m, rotations}; }             // NOLINT
  operator ConstPoseSpan() const { return {root_position_m, rotations}; }  // NOLINT
};

/// Computes the positions and world rotations of all joints. `positions` and `world_rotations` must
/// have one element per joint. Never allocates.
void ForwardKinematics(const Skeleton& skeleton, ConstPoseSpan pose, std::span<Vec3> positions,
                       std::span<Quat> world_rotations);

/// Returns the world position of the ball of a foot. Evaluates only the joints from the root to the
/// foot. Never allocates.
[[nodiscard]] Vec3 BallPosition(const Skeleton& skeleton, ConstPoseSpan pose, Foot foot);

/// Returns the world position of a point given in the frame of a joint.
[[nodiscard]] Vec3 PointPosition(const Skeleton& skeleton, ConstPoseSpan pose, int joint,
                                 const Vec3& offset_m);

/// Pose arithmetic (paper, Section 5). Sums do not commute:
///
///   A + B = {t_A + t_B, r_B r_A}
///   A - B = {t_A - t_B, r_B^-1 r_A}
///   c A = {c t_A, slerp(1, r_A, c)}
///
/// so that (A - B) + B = A. All poses must have the same number of joints. `out` may alias an
/// input.
void Add(ConstPoseSpan a, ConstPoseSpan b, PoseSpan out);
void Subtract(ConstPoseSpan a, ConstPoseSpan b, PoseSpan out);
void Scale(float c, ConstPoseSpan a, PoseSpan out);

/// Returns the largest angle between the rotations of the same joint in two poses, in radians.
[[nodiscard]] double LargestJointAngle(ConstPoseSpan a, ConstPoseSpan b);

}  // namespace stridewire
