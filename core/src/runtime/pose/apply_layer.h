#pragma once

#include "runtime/skeleton/layer_clip.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Rotates the joints of `pose` towards the clip at `time_s`: r slerp(1, r^-1 c, weight * mask),
/// along the short arc. The clip is C1 between its keys (Catmull-Rom). The time wraps around in a
/// loop and is clamped in other clips. `weight` is in [0, 1]. Never allocates. Joints outside the
/// mask do not change.
void ApplyLayer(const LayerClip& clip, double time_s, double weight, PoseSpan pose);

}  // namespace stridewire
