#pragma once

#include <optional>

#include "offline/extract/body_tracks.h"
#include "offline/extract/extract.h"
#include "offline/extract/ground.h"

namespace stridewire {

/// Returns the stillest moment of a clip in which both feet are side by side on the same ground and
/// the legs are straight. `heading_rad` is the stride heading per frame of the tracks. Returns
/// nullopt if both feet never stand.
[[nodiscard]] std::optional<Extraction::Stand> FindStand(const Skeleton& skeleton, const Clip& clip,
                                                         const BodyTracks& tracks,
                                                         const FootContacts& contacts,
                                                         const Ground& ground,
                                                         const std::vector<double>& heading_rad);

}  // namespace stridewire
