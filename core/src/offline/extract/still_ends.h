#pragma once

#include "offline/base/frame_range.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Returns the frames of a clip from `first_frame` on, without still poses at its ends that are
/// separated from the motion by a jump, for example a T-pose of one second before a walk. A figure
/// that stands still and then starts to move is part of the motion.
[[nodiscard]] FrameRange WithoutStillEnds(const Skeleton& skeleton, const Clip& clip,
                                          int first_frame);

}  // namespace stridewire
