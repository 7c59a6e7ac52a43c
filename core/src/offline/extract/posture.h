#pragma once

#include "offline/extract/body_tracks.h"

namespace stridewire {

/// Returns the height of the pelvis above the lower foot in metres.
[[nodiscard]] double PelvisHeight(const BodyTracks& tracks, int frame);

/// Returns true if the figure lies, or crawls on hands and knees or feet: the pelvis is low and the
/// trunk nearly horizontal. Returns false for a figure that only bends over or squats.
[[nodiscard]] bool LiesOrCrawls(const BodyTracks& tracks, int frame);

}  // namespace stridewire
