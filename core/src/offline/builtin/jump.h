#pragma once

#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// Generates a standing jump over `length_m` (0.2 to 1.6 m). Its keytimes are start, lowest point
/// of the crouch, toe-off, landing, lowest point of the absorption and end. The feet stay in place
/// before toe-off and after landing. The path of the centre of mass is prescribed, with a parabola
/// in flight. The position of the root is solved for this path.
[[nodiscard]] RawExample MakeJump(const Skeleton& figure, double length_m);

}  // namespace stridewire::builtin
