#pragma once

#include <string>

#include "offline/extract/extract.h"

namespace stridewire {

/// Returns why a library gets no movement from a capture, as at least one sentence: its error, or
/// the reason for which most of its time was rejected, or a general description of what is missing.
/// `steps` and `jumps` say which kinds are wanted. Returns an empty string if the capture has
/// movements of these kinds.
[[nodiscard]] std::string ReasonForNoMovements(const Extraction& extraction, bool steps,
                                               bool jumps);

}  // namespace stridewire
