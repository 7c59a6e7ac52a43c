#pragma once

#include "offline/base/frame_range.h"
#include "stridewire/runtime/clip.h"

namespace stridewire {

/// Cuts frames out of a clip and transforms them to the base frame in which a movement starts
/// (paper, Section 5):
///
///   r_root <- q_h^-1 r_root,   t <- q_h^-1 (t - t_0),   q_h = rotation by `heading_rad` about +Y
///
/// with t_0 = (x of the first frame, `ground_m`, z of the first frame). Unlike in the paper, y is
/// not moved to the origin, because the height of an avatar would then be a random walk. The
/// heading is an argument (the stride heading), because the heading of the pelvis oscillates with
/// every step. The signs of successive quaternions become continuous. `frames` must be a non-empty
/// range within the clip.
[[nodiscard]] Clip NormaliseClip(const Clip& clip, const FrameRange& frames, double heading_rad,
                                 double ground_m);

}  // namespace stridewire
