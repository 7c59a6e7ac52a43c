#pragma once

#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// The generated figure's example seen in a mirror: x -> -x, (x, y, z, w) -> (x, -y, -z, w), sides
/// swapped (paper, Section 6: the other foot's steps are mirror images).
[[nodiscard]] RawExample Mirrored(const RawExample& example);

}  // namespace stridewire::builtin
