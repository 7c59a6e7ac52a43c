#pragma once

#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Removes noise from the root in place (decision 0059). The rotation and position of the pelvis
/// follow from a few markers on the waist. If these markers slip, the pelvis shakes from frame to
/// frame. The feet stand still nevertheless, because the hips compensate for the shaking.
///
/// The root is filtered if its angular acceleration exceeds 600 rad/s^2, or its acceleration 90
/// m/s^2, in more than 10 % of the frames. A Gaussian filter halves the amplitude at 12 Hz.
///
/// - The world positions of the ankles are filtered in the same way. The feet keep their world
///   rotations, and each knee bends in the plane of its leg.
/// - The world rotations of the other children of the root, such as the spine, are filtered in the
///   same way.
///
/// Frames before `first_frame` remain unchanged. Returns false and changes nothing if the limits
/// are not exceeded, if there are fewer than three frames, or if a leg has other joints between
/// hip, knee and ankle.
bool RemoveRootNoise(const Skeleton& skeleton, int first_frame, Clip& clip);

}  // namespace stridewire
