#pragma once

#include <optional>
#include <vector>

#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Returns the index of the mirrored joint for each joint. Joints on the spine map to themselves.
///
/// Joints are paired by names. A side is Left or Right anywhere in the name, or a single L or R, l
/// or r, at the start of the name or as a word of its own. If the names do not pair all joints,
/// joints are paired by shape. In this case the legs are partners. Other joints are partners if
/// their bones, including all bones below, have equal lengths (within 8 % plus 1 cm) and point in
/// mirrored directions (within 60 degrees). Directions are those of the pose `reference`, which
/// must face +Z.
///
/// Returns nullopt if a joint off the plane of symmetry has no partner.
[[nodiscard]] std::optional<std::vector<int>> FindMirrorJoints(const Skeleton& skeleton,
                                                               ConstPoseSpan reference);

}  // namespace stridewire
