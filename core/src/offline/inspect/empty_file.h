#pragma once

#include <string>

#include "offline/extract/extract.h"

namespace stridewire {

/// Returns why a capture contributes no movement to a library, in at least one sentence. The reason
/// is its error, or that it contains only movements of the other kind, or
/// Extraction::no_movement_reason, or the reason for which most of its time was rejected. `steps`
/// and `jumps` state which kinds are requested. Returns an empty string if the capture contains
/// movements of these kinds.
[[nodiscard]] std::string ReasonForNoMovements(const Extraction& extraction, bool steps,
                                               bool jumps);

}  // namespace stridewire
