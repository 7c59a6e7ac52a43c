#pragma once

#include "runtime/skeleton/layer_clip.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Rotates the joints of `pose` towards their rotations in the clip at `time_s`. A rotation r
/// becomes r slerp(1, r^-1 c, w) along the short arc, where c is the rotation in the clip and w is
/// `weight`, in [0, 1], times the joint's weight in LayerClip::weights. Joints that are not in the
/// clip do not change.
///
/// The keys of the clip are interpolated with continuous velocity (Catmull-Rom). In looping clips
/// the time wraps around; in other clips it is clamped. Never allocates.
void ApplyLayer(const LayerClip& clip, double time_s, double weight, PoseSpan pose);

}  // namespace stridewire
