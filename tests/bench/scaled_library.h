#pragma once

#include <memory>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Returns a library with the straight steps of the generated library, but with another number of
/// examples per foot (at least 4) or of joints (at least the original number). Benchmarks use it to
/// measure the influence of these numbers. Additional examples are blends of the original ones.
/// Additional joints form chains of ten on the root and rotate like other joints. Aborts if the
/// library cannot be built.
[[nodiscard]] std::shared_ptr<const MotionLibrary> MakeScaledLibrary(int examples, int joints);

}  // namespace stridewire
