#pragma once

#include <string>

#include "offline/extract/extract.h"

namespace stridewire {

/// Returns why a capture contributes no movement to a library, in at least one sentence. The reason
/// is its error, or the reason for which most of its time was rejected, or a general description of
/// what is missing. `steps` and `jumps` state which kinds are requested. Returns an empty string if
/// the capture contains movements of these kinds.
[[nodiscard]] std::string ReasonForNoMovements(const Extraction& extraction, bool steps,
                                               bool jumps);

}  // namespace stridewire
