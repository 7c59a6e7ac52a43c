#pragma once

#include <vector>

#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Returns true for the last joints of limbs: fingers, thumbs and toes. Less than 15 cm of the body
/// are beyond them.
[[nodiscard]] bool IsLimbEnd(const Skeleton& skeleton, int joint);

/// Removes noise from feet and hands in place (decision 0046). Otherwise, the toes of standing feet
/// flutter by several degrees, and soles leave the ground. Joints are filtered if their angular
/// acceleration exceeds a limit in more than 1 % of the frames.
///
/// - Fingers, thumbs and toes: limit 1000 rad/s^2. Their rotations follow from markers that are a
///   few centimetres apart. A median over 67 ms removes flips, and a mean with Gaussian weights
///   takes half of the amplitude of vibrations at 7.5 Hz.
/// - Ankles: limit 2000 rad/s^2. The mean takes half of the amplitude at 19 Hz.
///
/// Frames before `first_frame` remain unchanged. Returns the joints that were filtered, in order.
std::vector<int> RemoveJointNoise(const Skeleton& skeleton, int first_frame, Clip& clip);

}  // namespace stridewire
