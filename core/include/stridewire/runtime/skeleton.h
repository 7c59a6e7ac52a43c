#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"

namespace stridewire {

/// Left or right foot, from the point of view of the figure. A step is named after the moving foot.
enum class Foot : std::uint8_t { kLeft = 0, kRight = 1 };

[[nodiscard]] constexpr Foot OtherFoot(Foot foot) {
  return foot == Foot::kLeft ? Foot::kRight : Foot::kLeft;
}

struct Joint {
  std::string name;
  int parent = -1;  ///< Index of the parent, always below the joint's own index; -1 for the root.
  Vec3 offset_m = Vec3(0.0f);  ///< Position in the frame of the parent; unused for the root.
};

/// The end of a chain of joints (BVH `End Site`). It has no rotation.
struct EndSite {
  int joint = 0;               ///< Index of the last joint of the chain.
  Vec3 offset_m = Vec3(0.0f);  ///< Position in the frame of that joint.
};

/// Indices of the joints of one leg. Positions of feet are measured at the ball, which moves less
/// than the ankle while a standing foot rolls. If the skeleton has no toe joint, `ball` is the
/// index of the ankle.
struct Leg {
  int hip = -1;
  int knee = -1;
  int ankle = -1;
  int ball = -1;
  /// Position of the ball of the foot in the frame of joint `ball`.
  Vec3 ball_offset_m = Vec3(0.0f);
  Vec3 toe_tip_offset_m = Vec3(0.0f);  ///< Position of the tip of the toes in the same frame.
};

/// A tree of joints. The root is first and parents precede their children. If all rotations are the
/// identity, the figure faces +Z with +Y up. Only the root has a translation; all other joints keep
/// their offsets.
struct Skeleton {
  std::vector<Joint> joints;
  std::vector<EndSite> end_sites;
  Leg legs[2];  ///< The two legs, indexed by Foot.

  [[nodiscard]] int joint_count() const { return static_cast<int>(joints.size()); }
  [[nodiscard]] const Leg& leg(Foot foot) const { return legs[static_cast<int>(foot)]; }

  /// Returns the index of the joint with this name, or -1.
  [[nodiscard]] int FindJoint(std::string_view name) const;

  /// Checks the skeleton. Errors: kOutOfRange if there are no joints or more than kMaxJoints, if a
  /// joint precedes its parent, or if a leg or an end site refers to a joint that does not exist.
  /// kInvalidArgument if an offset is not finite or a coordinate of it exceeds kMaxOffsetM, or if a
  /// name is empty or a duplicate.
  [[nodiscard]] Status Validate() const;
};

inline constexpr int kMaxJoints = 256;
inline constexpr float kMaxOffsetM = 100.0f;

}  // namespace stridewire
