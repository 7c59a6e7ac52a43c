#pragma once

#include "offline/complete/step_maker.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire::complete {

/// Returns true if a captured group of the library can produce a step with these feet, because the
/// step is in the hull of the group's examples or close to it. `stand_side_m` is the sideways
/// distance from the fixed to the moving foot in the stand pose. It is assumed for groups without
/// sideways parameters.
[[nodiscard]] bool IsCaptured(const RawLibrary& library, Foot moving, const StepFeet& feet,
                              double stand_side_m);

}  // namespace stridewire::complete
