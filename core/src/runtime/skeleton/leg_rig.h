#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "stridewire/runtime/pose.h"

namespace stridewire {

inline constexpr int kMaxLegChain = 32;  ///< Legs with longer chains are not planted.

/// Properties of a skeleton's legs that planting needs, computed once per library.
struct LegRig {
  struct Side {
    std::vector<int> chain;  ///< Joints from the root (0) down to the ball's joint, in order.
    int hip = 0;             ///< Indices in `chain`.
    int knee = 0;
    int ankle = 0;
    float thigh_m = 0.0f;  ///< Distance from hip to knee. Joints in between do not bend.
    float shank_m = 0.0f;  ///< Distance from knee to ankle.
    /// Hinge axis of the knee in the frame of the hip joint, of unit length. A positive rotation
    /// about it moves the shank backward.
    Vec3 hinge = Vec3(0.0f);
    /// Height of the ball's centre above the ground in the stand pose.
    double ball_height_m = 0.0;
    double ankle_height_m = 0.0;  ///< Height of the ankle above the ground in the stand pose.
    /// Direction from ankle to ball in the stand pose, relative to its heading.
    double toe_out_rad = 0.0;
    /// Height of the tip of the toes above the ground in the stand pose.
    double toe_height_m = 0.0;
    /// Position of the heel in the frame of the ankle: below and behind it, as high as the ball.
    Vec3 heel_m = Vec3(0.0f);
    double toe_m = 0.0;   ///< Horizontal distance from the ball to the tip of the toes.
    double foot_m = 0.0;  ///< Horizontal distance from the ankle to the ball in the stand pose.
  };
  /// A side and its offsets in flat arrays, for the planting kernels.
  struct Bones {
    std::size_t count = 0;               ///< Number of joints in the chain.
    std::size_t joints[kMaxLegChain]{};  ///< [index in chain]
    /// [index in chain]: index of the joint in LegRig::joints.
    std::size_t rig_joints[kMaxLegChain]{};
    /// [index in chain]: offset in the frame of the previous joint.
    float offsets_m[kMaxLegChain][3]{};
    std::size_t hip = 0;  ///< Indices in the chain.
    std::size_t knee = 0;
    std::size_t ankle = 0;
    float ball_m[3]{};     ///< Position of the ball in the frame of the last joint.
    float toe_tip_m[3]{};  ///< Position of the tip of the toes in the frame of the last joint.
    float heel_m[3]{};     ///< Position of the heel in the frame of the ankle.
    float hinge[3]{};      ///< Hinge axis of the knee in the frame of the hip joint.
    float thigh_m = 0.0f;
    float shank_m = 0.0f;
    float ball_height_m = 0.0f;
    float toe_height_m = 0.0f;
    float toe_out_rad = 0.0f;
    float foot_m = 0.0f;
  };

  std::array<Side, 2> sides;   ///< [foot]
  std::array<Bones, 2> bones;  ///< [foot]: bones of the leg; set if the rig is usable.
  static constexpr std::size_t kMaxJointsOfLegs = 2 * kMaxLegChain - 1;
  /// Joints of both chains, in increasing order, the root first. Set if usable.
  std::vector<int> joints;
  /// True if each leg is a chain of hip, knee, ankle and ball with bones of positive length.
  /// Otherwise feet are not planted.
  bool is_usable = false;

  [[nodiscard]] const Side& side(Foot foot) const { return sides[static_cast<std::size_t>(foot)]; }
};

inline constexpr double kSoleBehindAnkleM =
    /// Distance of the heel behind the ankle. It is an assumption, because skeletons have no heel
    /// joint.
    0.06;

/// `knee_hinges` [foot]: see LegRig::Side::hinge.
[[nodiscard]] LegRig MakeLegRig(const Skeleton& skeleton, ConstPoseSpan stand_pose,
                                const std::array<Vec3, 2>& knee_hinges);

/// A leg of a pose, from forward kinematics along its chain. Positions are relative to the root, in
/// world axes, so that floats stay precise far from the origin.
struct LegPose {
  std::array<Vec3, kMaxLegChain> positions_m;      ///< [index in chain]
  std::array<Quat, kMaxLegChain> world_rotations;  ///< [index in chain]
  Vec3 ball_m = Vec3(0.0f);
  Vec3 toe_tip_m = Vec3(0.0f);
  Vec3 heel_m = Vec3(0.0f);

  /// Returns the heading of the foot: the direction from ankle to ball.
  [[nodiscard]] double FootHeading(const LegRig::Side& side) const;
  /// Returns the horizontal fraction of the foot's length: 1 with the sole on the ground as in the
  /// stand pose, less with the heel up, and 0 if the ball is at the ankle.
  [[nodiscard]] double Flatness(const LegRig::Side& side) const;
  /// Returns the height of the foot relative to the root, minus its height above the ground in the
  /// stand pose, at that point of ankle, ball and tip of the toes where the difference is smallest.
  /// The tip of the toes may be a little lower.
  /// If the root is at height y, a foot that stands on level ground at height g has
  /// y + LowestSole = g, also while it rolls over the heel or the toes.
  [[nodiscard]] double LowestSole(const LegRig::Side& side) const;
};

void EvaluateLeg(const Skeleton& skeleton, const LegRig& rig, ConstPoseSpan pose, Foot foot,
                 LegPose& out);

/// Moves the ankle of a leg to `ankle_m` (relative to the root) with world rotation
/// `ankle_rotation`, by two-bone inverse kinematics in the plane of the knee in `leg`. The knee
/// never bends backward. A target further away than kMaxLegExtension times the length of the leg is
/// approached as far as that. Writes the rotations of hip, knee and ankle. Uses square roots and
/// divisions only.
void SolveLeg(const LegRig& rig, Foot foot, const LegPose& leg, const Vec3& ankle_m,
              const Quat& ankle_rotation, PoseSpan pose);

inline constexpr float kMaxLegExtension = 0.9995f;

}  // namespace stridewire
