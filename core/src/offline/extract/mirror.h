#pragma once

#include <optional>
#include <span>
#include <vector>

#include "offline/extract/extract.h"
#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Describes how a skeleton is mirrored at the plane x = 0.
struct SkeletonMirror {
  std::vector<int> partners;  ///< See FindMirrorJoints.
  /// [joint]: rotation from the joint's own frame to the mirror image of its partner's frame. If M
  /// is the reflection x -> -x, and W and W' are world rotations before and after mirroring:
  ///
  ///   W'_j = M W_p M turns[j],   p = partners[j]
  ///
  /// The turn maps the bones of the joint to the mirror images of its partner's bones. Mirrored
  /// bones therefore point in mirrored directions, whatever the axes of the joints' frames are.
  std::vector<DQuat> turns;
};

/// Properties of a figure's posture, averaged over its examples, that mirroring uses.
struct Posture {
  /// Mean of each joint's rotation relative to its parent, and of the root's relative to the
  /// heading. The root is at the origin. The identity if there are no examples.
  Pose mean;
  /// [joint]: true if the joint does not rotate relative to its parent.
  std::vector<bool> is_rigid;
  /// [joint]: mean up direction in the joint's own frame while its foot stands flat on the ground,
  /// as a unit vector. Zero for joints that do not belong to a foot, and for feet that never stand
  /// while the other foot swings.
  std::vector<DVec3> sole_up;
};

[[nodiscard]] Posture MeasurePosture(const Skeleton& skeleton,
                                     std::span<const ExtractedExample* const> examples);

/// Returns the mirror of a skeleton, or nullopt if its joints cannot be paired (FindMirrorJoints).
///
/// A joint and the joints that are rigid relative to it form one body. If the bones of a body have
/// different directions, they determine its turn. A single bone does not determine the rotation
/// about itself, so that rotation is chosen to change the mean posture as little as possible. Bones
/// of a foot are mirrored as seen from above. A flat sole thus stays flat, even if the balls of
/// both feet are at different heights.
[[nodiscard]] std::optional<SkeletonMirror> FindSkeletonMirror(const Skeleton& skeleton,
                                                               const Posture& posture);

/// Returns the mirror image of a movement. A left step becomes a right step. Sideways parameters
/// and the turn change sign. Bones keep their own lengths. In a figure that is not perfectly
/// symmetric, the parameters of steps are therefore measured again at the balls. `names` are the
/// names of `source.example.parameters`.
[[nodiscard]] ExtractedExample MirrorExample(const Skeleton& skeleton, const SkeletonMirror& mirror,
                                             std::span<const ParameterName> names,
                                             const ExtractedExample& source);

}  // namespace stridewire
