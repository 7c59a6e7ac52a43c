#pragma once

#include <optional>
#include <span>
#include <vector>

#include "offline/extract/extract.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Returns the index of the mirrored joint for each joint; joints on the spine map to themselves.
///
/// Joints are paired by names: Left/Right anywhere in the name, or a leading L/R or l/r. If the
/// names do not pair all joints, they are paired by shape. Then the legs are partners, and so are
/// joints whose bones, including all bones below, are mirror images at identity rotations (within 8
/// % and 1 cm). Returns nullopt if a joint off the plane of symmetry remains without partner.
[[nodiscard]] std::optional<std::vector<int>> FindMirrorJoints(const Skeleton& skeleton);

/// Returns the mirror image of a movement: x -> -x, rotations (x, -y, -z, w), sides swapped. A left
/// step becomes a right step; sideways parameters and the turn change sign. `partners` is the
/// result of FindMirrorJoints. The parameters of steps are measured again at the balls, since no
/// figure is perfectly symmetric. `names` are the names of `source.example.parameters`.
[[nodiscard]] ExtractedExample MirrorExample(const Skeleton& skeleton,
                                             const std::vector<int>& partners,
                                             std::span<const ParameterName> names,
                                             const ExtractedExample& source);

}  // namespace stridewire
