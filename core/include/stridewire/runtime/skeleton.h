#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"

namespace stridewire {

/// Left and right as the figure has them; a step is named after the foot that moves.
enum class Foot : std::uint8_t { kLeft = 0, kRight = 1 };

[[nodiscard]] constexpr Foot OtherFoot(Foot foot) {
  return foot == Foot::kLeft ? Foot::kRight : Foot::kLeft;
}

struct Joint {
  std::string name;
  int parent = -1;  ///< Index of the parent, always smaller than its own; -1 for the root.
  Vec3 offset_m = Vec3(0.0f);  ///< Where the joint sits in its parent's frame; unused for the root.
};

/// The tip of a chain (BVH `End Site`): no rotation of its own.
struct EndSite {
  int joint = 0;
  Vec3 offset_m = Vec3(0.0f);
};

/// The joints of one leg, as indices. `ball` carries the ball of the foot, where feet are measured
/// (over a step ankles drift 6.5 cm by foot roll, balls 3.6); a figure without a toe joint has it
/// on the ankle with an offset.
struct Leg {
  int hip = -1;
  int knee = -1;
  int ankle = -1;
  int ball = -1;
  Vec3 ball_offset_m = Vec3(0.0f);     ///< The ball in the frame of joint `ball`.
  Vec3 toe_tip_offset_m = Vec3(0.0f);  ///< The tip of the toes in the frame of joint `ball`.
};

/// A tree of joints, root first, parents before children. At identity rotations the figure faces
/// +Z with +Y up. Only the root moves; every other joint keeps its offset.
struct Skeleton {
  std::vector<Joint> joints;
  std::vector<EndSite> end_sites;
  Leg legs[2];  ///< Indexed by Foot.

  [[nodiscard]] int joint_count() const { return static_cast<int>(joints.size()); }
  [[nodiscard]] const Leg& leg(Foot foot) const { return legs[static_cast<int>(foot)]; }

  /// Index of the joint of that name, -1 if there is none.
  [[nodiscard]] int FindJoint(std::string_view name) const;

  /// kOutOfRange: no joint, more than kMaxJoints, a parent not before its child, a leg's joint
  /// index outside; kInvalidArgument: an offset is not finite, a name is empty or stands twice.
  [[nodiscard]] Status Validate() const;
};

inline constexpr int kMaxJoints = 256;
inline constexpr float kMaxOffsetM = 100.0f;

}  // namespace stridewire
