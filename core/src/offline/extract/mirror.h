#pragma once

#include <optional>
#include <span>
#include <vector>

#include "offline/extract/extract.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// The joint on the other side of each joint (itself on the spine), by names: Left/Right at the
/// start or anywhere in the name, or a leading L/R or l/r before an upper-case letter. Where names do not
/// pair all joints, by shape: the two legs are each other's partners, and any two joints whose bones and
/// all below them are mirror images (within 8 % and 1 cm) of each other at identity rotations. Nothing
/// if that leaves a joint off the plane between the sides without a partner.
[[nodiscard]] std::optional<std::vector<int>> FindMirrorJoints(const Skeleton& skeleton);

/// The movement seen in a mirror: x -> -x, rotations (x, -y, -z, w), sides swapped, so a left step
/// becomes a right one; sideways parameters and the turn change sign. `partners` is
/// FindMirrorJoints of the skeleton; of steps the parameters are measured again at the balls, since
/// no figure is quite symmetric. `names` are those of `source.example.parameters`.
[[nodiscard]] ExtractedExample MirrorExample(const Skeleton& skeleton,
                                             const std::vector<int>& partners,
                                             std::span<const ParameterName> names,
                                             const ExtractedExample& source);

}  // namespace stridewire
