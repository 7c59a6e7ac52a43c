#pragma once

#include <optional>

#include "offline/extract/body_tracks.h"
#include "offline/extract/extract.h"
#include "offline/extract/ground.h"

namespace stridewire {

/// Returns the pose of a clip that is closest to standing still and upright with flat feet side by
/// side. `heading_rad` contains the stride heading for each frame of the tracks. Returns nullopt if
/// the feet never stand on the same ground at the same time.
[[nodiscard]] std::optional<Extraction::Stand> FindStand(const Skeleton& skeleton, const Clip& clip,
                                                         const BodyTracks& tracks,
                                                         const FootContacts& contacts,
                                                         const Ground& ground,
                                                         const std::vector<double>& heading_rad);

}  // namespace stridewire
