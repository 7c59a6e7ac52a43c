#pragma once

#include <optional>

#include "offline/extract/ground.h"
#include "offline/extract/body_tracks.h"
#include "offline/extract/extract.h"

namespace stridewire {

/// The quietest moment of a clip with both feet on the same ground, side by side and legs straight.
/// `heading_rad`: stride heading, one value a frame of the tracks.
[[nodiscard]] std::optional<Extraction::Stand> FindStand(const Skeleton& skeleton, const Clip& clip,
                                                         const BodyTracks& tracks,
                                                         const FootContacts& contacts,
                                                         const Ground& ground,
                                                         const std::vector<double>& heading_rad);

}  // namespace stridewire
