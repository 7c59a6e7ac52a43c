#pragma once

#include <optional>
#include <span>
#include <vector>

#include "stridewire/offline/extract.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// The joint on the other side of each joint (itself on the spine), by names: Left/Right at the
/// start or anywhere in the name, or a leading L/R or l/r before an upper-case letter. Nothing if
/// a joint has no partner, or partners hang on joints that are none.
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
