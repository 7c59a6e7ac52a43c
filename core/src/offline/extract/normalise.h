#pragma once

#include "offline/base/frame_range.h"
#include "stridewire/runtime/clip.h"

namespace stridewire {

/// Cuts frames out of a clip and brings them into the frame a movement starts in (paper, Section 5):
///
///   r_root <- q_h^-1 r_root,   t <- q_h^-1 (t - t_0),   q_h = rotation by `heading_rad` about +Y
///
/// with t_0 = (x of the first frame, `ground_m`, z of the first frame). Only x and z are brought to
/// the origin: shifting y as well, as the paper does, makes the height of an avatar a random walk.
/// The heading is given (stride heading), not taken from the pelvis, which swings with every step.
/// Tracks come out continuous in sign. `frames` lie within the clip, at least one.
[[nodiscard]] Clip NormaliseClip(const Clip& clip, const FrameRange& frames, double heading_rad,
                                 double ground_m);

}  // namespace stridewire
