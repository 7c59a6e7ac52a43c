#pragma once

#include <span>

#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// Returns the mirror image of an example of the generated figure with parameters `names`: x -> -x,
/// (x, y, z, w) -> (x, -y, -z, w), sides swapped (paper, Section 6: steps of the other foot).
[[nodiscard]] RawExample Mirrored(const RawExample& example, std::span<const ParameterName> names);

/// Returns a straight step reversed in time, which is a step backward: people walk backward much
/// like that (Winter, Pluck, Yang 1989). The parameters are start_z and end_z. The result takes
/// `slowdown` times as long.
[[nodiscard]] RawExample Reversed(const RawExample& example, double slowdown = 1.0);

}  // namespace stridewire::builtin
