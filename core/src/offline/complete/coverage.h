#pragma once

#include "offline/complete/step_maker.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire::complete {

/// Returns true if some captured group of the library contains a step with these feet, or nearly
/// so: if it is in the hull of a group's examples, or close to it. `stand_side_m` is the sideways
/// distance of the moving from the fixed foot in the stand pose, which groups without sideways
/// parameters assume.
[[nodiscard]] bool IsCaptured(const RawLibrary& library, Foot moving, const StepFeet& feet,
                              double stand_side_m);

}  // namespace stridewire::complete
