#pragma once

#include <vector>

#include "offline/extract/body_tracks.h"
#include "offline/extract/contacts.h"

namespace stridewire {

/// Returns the stride heading for every frame of the tracks: the pelvis yaw averaged over one
/// stride (two step durations, centred). It is unwrapped, and positive is left.
///
/// Even in straight walks, the pelvis yaws by 5 to 13 degrees with every step. If its yaw were the
/// heading, sequences of straight steps would veer. Near the ends of a recording, half of
/// the stride is missing. There, the function fits a line plus an oscillation of stride length. The
/// priors are 0 +- 50 degrees/s for the slope and 8 degrees for the oscillation.
[[nodiscard]] std::vector<double> StrideHeading(const BodyTracks& tracks,
                                                const FootContacts& contacts);

}  // namespace stridewire
