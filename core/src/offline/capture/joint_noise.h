#pragma once

#include <vector>

#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Returns true for the last joints of limbs (fingers, thumbs, toes): the body extends less than 15
/// cm beyond them.
[[nodiscard]] bool IsLimbEnd(const Skeleton& skeleton, int joint);

/// Removes noise from feet and hands in place (decision 0046). Noise makes the toes of standing
/// feet flutter by several degrees, and soles leave the ground. A joint is filtered if its angular
/// acceleration exceeds a limit in more than 1 % of the frames.
///
/// - Fingers, thumbs and toes: the limit is 1000 rad/s^2. Their rotations are derived from markers
///   that are only a few centimetres apart. A median over 67 ms removes flips. A Gaussian filter
///   then halves the amplitude of vibrations at 7.5 Hz.
/// - Ankles: the limit is 2000 rad/s^2. A Gaussian filter halves the amplitude at 19 Hz.
///
/// Frames before `first_frame` remain unchanged. Returns the joints that were filtered, in order.
std::vector<int> RemoveJointNoise(const Skeleton& skeleton, int first_frame, Clip& clip);

}  // namespace stridewire
