#pragma once

#include <memory>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// The straight steps of the generated library with another number of examples a foot (at least 4) or of joints (at least
/// as many as it has), for benchmarks of what either costs. More examples are blends of those there are; joints more are
/// chains of ten on the first joint's head that turn as others do. Aborts if the builder refuses.
[[nodiscard]] std::shared_ptr<const MotionLibrary> MakeScaledLibrary(int examples, int joints);

}  // namespace stridewire
