#pragma once

#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// A standing jump forward over `length_m` (0.2..1.6), from standing to standing. Keytimes: start,
/// lowest of the crouch, toe-off, landing, lowest of the absorption, end. The feet stay where they
/// are until toe-off and from landing on; the centre of the body is led, in flight along its
/// parabola, and the root solved for it.
[[nodiscard]] RawExample MakeJump(const Skeleton& figure, double length_m);

}  // namespace stridewire::builtin
