#pragma once

#include <memory>

#include "stridewire/offline/raw_library.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// A walker of seven joints whose steps are exact in closed form: straight legs that swing like
/// compasses, 15 steps a foot over lengths 0, 0.2, 0.4, 0.6 m, jumps of 0.3 to 1.2 m. For tests that
/// must know the truth without asking the code under test.
[[nodiscard]] RawLibrary MakeToyRawLibrary();

/// The same, built. Aborts if the builder refuses.
[[nodiscard]] std::shared_ptr<const MotionLibrary> MakeTestLibrary();

}  // namespace stridewire
