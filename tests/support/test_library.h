#pragma once

#include <memory>

#include "stridewire/offline/raw_library.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Returns the examples of a walker with seven joints whose motion has a closed form, for tests
/// that need expected values independent of the code under test. Its straight legs swing like those
/// of a pair of compasses. There are 15 steps per foot with lengths 0, 0.2, 0.4 and 0.6 m, and
/// jumps of 0.3 to 1.2 m.
[[nodiscard]] RawLibrary MakeTestRawLibrary();

/// Builds the library of MakeTestRawLibrary. Aborts on failure.
[[nodiscard]] std::shared_ptr<const MotionLibrary> MakeTestLibrary();

}  // namespace stridewire
