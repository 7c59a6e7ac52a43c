#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Maximum number of joints in the chain of a leg. If a leg has more, feet are not planted.
inline constexpr int kMaxLegChain = 32;

/// Properties of a skeleton's legs that planting needs, computed once per library.
struct LegRig {
  struct Side {
    std::vector<int> chain;  ///< Joints from the root (0) down to the ball's joint, in order.
    int hip = 0;             ///< Indices of hip, knee and ankle in `chain`.
    int knee = 0;
    int ankle = 0;
    /// Distance from hip to knee in the stand pose. Planting does not bend joints in between.
    float thigh_m = 0.0f;
    float shank_m = 0.0f;  ///< Distance from knee to ankle in the stand pose.
    /// Hinge axis of the knee in the frame of the hip joint, of unit length. A positive rotation
    /// about it moves the shank backward.
    Vec3 hinge = Vec3(0.0f);
    /// Height of the ball (Leg::ball_offset_m) above the ground in the stand pose.
    double ball_height_m = 0.0;
    double ankle_height_m = 0.0;  ///< Height of the ankle above the ground in the stand pose.
    /// Heading of the foot (from ankle to ball) in the stand pose, in which the avatar has heading
    /// 0.
    double toe_out_rad = 0.0;
    /// Height of the toe tip above the ground in the stand pose.
    double toe_height_m = 0.0;
    /// Position of the heel in the frame of the ankle. In the stand pose, the heel is as high as
    /// the ball and kSoleBehindAnkleM behind the ankle.
    Vec3 heel_m = Vec3(0.0f);
    double toe_m = 0.0;   ///< Horizontal distance from the ball to the toe tip in the stand pose.
    double foot_m = 0.0;  ///< Horizontal distance from the ankle to the ball in the stand pose.
    /// Cosine and sine of the angle at the ankle, between the directions to the knee and to the
    /// ball, at which the flexion of the ankle is kAnkleLimitRad. A cosine of 2 disables this
    /// limit, for feet without a length.
    double ankle_limit_cosine = 2.0;
    double ankle_limit_sine = 1.0;
    /// True if the last joint of the chain is the ball, and its parent is the ankle. The toes can
    /// then stay flat while the heel rises.
    bool has_toe_joint = false;
  };
  /// The data of a Side, and the offsets of its joints, in flat arrays for the planting kernels.
  struct Bones {
    std::size_t count = 0;               ///< Number of joints in the chain.
    std::size_t joints[kMaxLegChain]{};  ///< [index in chain]
    /// [index in chain]: index of the joint in LegRig::joints.
    std::size_t rig_joints[kMaxLegChain]{};
    /// [index in chain]: offset in the frame of the previous joint.
    float offsets_m[kMaxLegChain][3]{};
    std::size_t hip = 0;  ///< Indices of hip, knee and ankle in the chain.
    std::size_t knee = 0;
    std::size_t ankle = 0;
    float ball_m[3]{};     ///< Position of the ball in the frame of the last joint.
    float toe_tip_m[3]{};  ///< Position of the toe tip in the frame of the last joint.
    float heel_m[3]{};     ///< Position of the heel in the frame of the ankle.
    float hinge[3]{};      ///< Hinge axis of the knee in the frame of the hip joint.
    float thigh_m = 0.0f;
    float shank_m = 0.0f;
    float ball_height_m = 0.0f;
    float toe_height_m = 0.0f;
    float toe_out_rad = 0.0f;
    float foot_m = 0.0f;
    float ankle_limit_cosine = 2.0f;
    float ankle_limit_sine = 1.0f;
    bool has_toe_joint = false;
  };

  std::array<Side, 2> sides;   ///< [foot]
  std::array<Bones, 2> bones;  ///< [foot]: bones of the leg; set if the rig is usable.
  static constexpr std::size_t kMaxJointsOfLegs = 2 * kMaxLegChain - 1;
  /// Joints of both chains in increasing order, beginning with the root. Set if the rig is usable.
  std::vector<int> joints;
  /// True if each leg is a chain of root, hip, knee, ankle and ball with at most kMaxLegChain
  /// joints, and thighs and shanks are at least kSmallestBoneM long. Otherwise, feet are not
  /// planted.
  bool is_usable = false;

  [[nodiscard]] const Side& side(Foot foot) const { return sides[static_cast<std::size_t>(foot)]; }
};

/// Assumed distance of the heel behind the ankle, because skeletons have no heel joint. In metres.
inline constexpr double kSoleBehindAnkleM = 0.06;

/// Computes the rig of a skeleton. `knee_hinges` has one LegRig::Side::hinge per foot.
[[nodiscard]] LegRig MakeLegRig(const Skeleton& skeleton, ConstPoseSpan stand_pose,
                                const std::array<Vec3, 2>& knee_hinges);

/// A leg of a pose, computed by forward kinematics along its chain. Positions are relative to the
/// root, in world axes, so that floats stay precise far from the origin.
struct LegPose {
  std::array<Vec3, kMaxLegChain> positions_m;      ///< [index in chain]
  std::array<Quat, kMaxLegChain> world_rotations;  ///< [index in chain]
  Vec3 ball_m = Vec3(0.0f);
  Vec3 toe_tip_m = Vec3(0.0f);
  Vec3 heel_m = Vec3(0.0f);

  /// Returns the heading of the foot: the direction from ankle to ball.
  [[nodiscard]] double FootHeading(const LegRig::Side& side) const;
  /// Returns the horizontal distance from ankle to ball as a fraction of that in the stand pose: 1
  /// with the sole on the ground, and less with the heel up. Returns 0 if the foot has no length
  /// (LegRig::Side::foot_m).
  [[nodiscard]] double Flatness(const LegRig::Side& side) const;
  /// Computes a difference for ankle, ball and toe tip: the height of the point relative to the
  /// root, minus its height above the ground in the stand pose. Returns the smallest of the three.
  /// For the toe tip, 5 mm are added first, because toes bend before they lift the foot.
  ///
  /// If the root is at height y, a foot that stands on level ground at height g has y + LowestSole
  /// = g, even while it rolls over the heel or the toes.
  [[nodiscard]] double LowestSole(const LegRig::Side& side) const;
};

void EvaluateLeg(const Skeleton& skeleton, const LegRig& rig, ConstPoseSpan pose, Foot foot,
                 LegPose& out);

/// Moves the ankle of a leg to `ankle_m` (relative to the root) with world rotation
/// `ankle_rotation`, by two-bone inverse kinematics in the plane of `leg`. The knee never bends
/// backward. If the target is further away than kMaxLegExtension times the leg length, the leg
/// extends to that length. Writes the rotations of hip, knee and ankle to `pose`, from which `leg`
/// was evaluated. Uses only square roots and divisions, no trigonometry.
void SolveLeg(const LegRig& rig, Foot foot, const LegPose& leg, const Vec3& ankle_m,
              const Quat& ankle_rotation, PoseSpan pose);

/// Maximum distance from hip to ankle, as a fraction of the sum of thigh and shank (SolveLeg).
inline constexpr float kMaxLegExtension = 0.9995f;

}  // namespace stridewire
