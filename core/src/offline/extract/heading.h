#pragma once

#include <vector>

#include "offline/extract/body_tracks.h"
#include "offline/extract/contacts.h"

namespace stridewire {

/// Returns the stride heading for every frame of the tracks: the pelvis yaw averaged over one
/// stride (two step durations, centred). It is unwrapped, and positive is left.
///
/// Even in straight walks the pelvis yaws by 5 to 13 degrees with every step. Used as heading, it
/// would make forty equal steps veer by a quarter turn. Near the ends of a recording half of the
/// stride is missing. There a line plus an oscillation of stride length is fitted, with priors of
/// 0 +- 50 degrees/s for the slope and 8 degrees for the oscillation. A quarter stride from the end
/// this differs by 1.5 degrees from the full average, instead of 3.6.
[[nodiscard]] std::vector<double> StrideHeading(const BodyTracks& tracks,
                                                const FootContacts& contacts);

}  // namespace stridewire
