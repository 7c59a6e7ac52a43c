#pragma once

#include <string>

#include "offline/extract/extract.h"

namespace stridewire {

/// Returns why a capture contributes no movement to a library, in at least one sentence. The reason
/// is the error of the extraction, that the capture contains only movements of the other kind,
/// Extraction::no_movement_reason, or the reason for which the most time was rejected. `steps` and
/// `jumps` state which kinds are requested. Returns an empty string if the capture contains
/// movements of these kinds.
[[nodiscard]] std::string ReasonForNoMovements(const Extraction& extraction, bool steps,
                                               bool jumps);

}  // namespace stridewire
