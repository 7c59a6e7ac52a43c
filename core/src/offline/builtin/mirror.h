#pragma once

#include <span>

#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// The generated figure's example, with parameters `names`, seen in a mirror: x -> -x, (x, y, z, w) -> (x, -y, -z, w), sides
/// swapped (paper, Section 6: the other foot's steps are mirror images).
[[nodiscard]] RawExample Mirrored(const RawExample& example, std::span<const ParameterName> names);

/// A straight step run backward in time: a step backward, which people walk much like that (Winter,
/// Pluck, Yang 1989). Parameters are start_z and end_z.
[[nodiscard]] RawExample Reversed(const RawExample& example);

}  // namespace stridewire::builtin
