#pragma once

#include <span>

#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// Returns the mirror image of an example of the generated figure with parameters `names`: x -> -x,
/// (x, y, z, w) -> (x, -y, -z, w), and sides swapped (paper, Section 6: steps of the other foot).
[[nodiscard]] RawExample Mirrored(const RawExample& example, std::span<const ParameterName> names);

/// Returns a straight step reversed in time, which resembles a captured step backward (Winter,
/// Pluck, Yang 1989). The parameters are start_z and end_z. The duration is multiplied by
/// `slowdown`.
[[nodiscard]] RawExample Reversed(const RawExample& example, double slowdown = 1.0);

}  // namespace stridewire::builtin
