#pragma once

#include <memory>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Returns a library with the straight steps of the generated library, but with `examples` examples
/// per foot (at least 4) and `joints` joints (at least those of the generated library). Benchmarks
/// use it to measure the cost of either. Additional examples are blends of the existing ones.
/// Additional joints are chains of ten joints on the head, which rotate like existing joints.
/// Aborts if the builder reports an error.
[[nodiscard]] std::shared_ptr<const MotionLibrary> MakeScaledLibrary(int examples, int joints);

}  // namespace stridewire
