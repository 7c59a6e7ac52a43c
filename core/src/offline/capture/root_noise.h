#pragma once

#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Removes noise from the root in place (decision 0059). The rotation and position of the pelvis
/// follow from a few markers on the waist. If these slip, the pelvis shakes from frame to frame
/// while the feet stand still, because the hips compensate it. In an avatar, the pelvis would shake
/// visibly, above all where steps are played faster.
///
/// The root is filtered if its angular acceleration exceeds 600 rad/s^2, or its acceleration 90
/// m/s^2, in more than 10 % of the frames. A Gaussian mean halves the amplitude at 12 Hz.
///
/// - The positions of the ankles in the world are filtered like that of the root. Feet keep their
///   rotations in the world. The legs bend in their planes.
/// - The rotations in the world of the other children of the root, such as the spine, are filtered
///   like that of the root.
///
/// Frames before `first_frame` remain unchanged. Returns false if the root was not filtered, also
/// if the joints of a leg do not follow one another.
bool RemoveRootNoise(const Skeleton& skeleton, int first_frame, Clip& clip);

}  // namespace stridewire
