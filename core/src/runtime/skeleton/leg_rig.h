#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "stridewire/runtime/pose.h"

namespace stridewire {

inline constexpr int kMaxLegChain = 32;  ///< Longer chains are not planted.

/// What planting needs to know of a skeleton's legs, worked out once for a library.
struct LegRig {
  struct Side {
    std::vector<int> chain;  ///< Joints from the root (0) down to the ball's, in order.
    int hip = 0;             ///< Places in `chain`.
    int knee = 0;
    int ankle = 0;
    float thigh_m = 0.0f;        ///< Hip to knee; intermediate joints do not bend.
    float shank_m = 0.0f;        ///< Knee to ankle.
    double ball_height_m = 0.0;  ///< Of the ball's centre over the ground the stand pose stands on.
    double toe_out_rad = 0.0;   ///< Where ankle to ball points in the stand pose, from its heading.
    double toe_height_m = 0.0;  ///< Of the tip of the toes over that ground.
    Vec3 heel_m = Vec3(0.0f);   ///< Below and behind the ankle, in its frame, as high as the ball
    double toe_m = 0.0;         ///< Ball to the tip of the toes, likewise.
    double foot_m = 0.0;        ///< Ankle to ball as seen from above, in the stand pose.
  };
  /// A side and its skeleton's offsets laid out flat, for the vectors that plant a crowd.
  struct Bones {
    std::size_t count = 0;                   ///< Joints of the chain
    std::size_t joints[kMaxLegChain]{};      ///< [place in chain]
    std::size_t rig_joints[kMaxLegChain]{};  ///< The same, as places in LegRig::joints
    float offsets_m[kMaxLegChain][3]{};      ///< [place in chain]: in the frame of the one before
    std::size_t hip = 0;                     ///< Places in the chain
    std::size_t knee = 0;
    std::size_t ankle = 0;
    float ball_m[3]{};     ///< In the frame of the last
    float toe_tip_m[3]{};  ///< The same
    float heel_m[3]{};     ///< In the frame of the ankle
    float thigh_m = 0.0f;
    float shank_m = 0.0f;
    float ball_height_m = 0.0f;
    float toe_height_m = 0.0f;
    float toe_out_rad = 0.0f;
    float foot_m = 0.0f;
  };

  std::array<Side, 2> sides;   ///< Indexed by Foot.
  std::array<Bones, 2> bones;  ///< Indexed by Foot; of a usable rig.
  static constexpr std::size_t kMaxJointsOfLegs = 2 * kMaxLegChain - 1;
  std::vector<int> joints;  ///< Of both chains, growing: the root is the first. Of a usable rig.
  /// Whether each leg is a chain hip, knee, ankle, ball with lengths to bend. If not, feet are not
  /// planted.
  bool is_usable = false;

  [[nodiscard]] const Side& side(Foot foot) const { return sides[static_cast<std::size_t>(foot)]; }
};

inline constexpr double kSoleBehindAnkleM =
    0.06;  ///< Skeletons have no heel: where it is taken to be.

[[nodiscard]] LegRig MakeLegRig(const Skeleton& skeleton, ConstPoseSpan stand_pose);

/// A leg of a pose, by forward kinematics down its chain. Positions are relative to the root, in
/// world axes, so that floats stay fine far from the origin.
struct LegPose {
  std::array<Vec3, kMaxLegChain> positions_m;      ///< [place in chain]
  std::array<Quat, kMaxLegChain> world_rotations;  ///< [place in chain]
  Vec3 ball_m = Vec3(0.0f);
  Vec3 toe_tip_m = Vec3(0.0f);
  Vec3 heel_m = Vec3(0.0f);

  /// Where the foot points: heading of ankle to ball.
  [[nodiscard]] double FootHeading(const LegRig::Side& side) const;
  /// 1 with the sole on the ground as in the stand pose, less with the heel up: the part of the
  /// foot's length that is seen from above. 0 where the ball lies on the ankle.
  [[nodiscard]] double Flatness(const LegRig::Side& side) const;
};

void EvaluateLeg(const Skeleton& skeleton, const LegRig& rig, ConstPoseSpan pose, Foot foot,
                 LegPose& out);

/// Puts the ankle of a leg at `ankle_m` (relative to the root) with world rotation
/// `ankle_rotation`: two-bone inverse kinematics in the knee plane of `leg`, the pose as it is. The
/// knee never bends backward. A target beyond `kMaxLegExtension` of the leg is approached as far as
/// that. Writes the rotations of hip, knee and ankle; square roots and divisions only.
void SolveLeg(const LegRig& rig, Foot foot, const LegPose& leg, const Vec3& ankle_m,
              const Quat& ankle_rotation, PoseSpan pose);

inline constexpr float kMaxLegExtension = 0.9995f;

}  // namespace stridewire
