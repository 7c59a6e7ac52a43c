#pragma once

#include "offline/build/grid_example.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

// Smooths trunk, head and arms of an example where they jolt (decision 0048). A joint jolts if its
// angular acceleration over two grid cells exceeds 400 rad/s^2, both relative to its parent and in
// the world. Jolts are noise of the recording that remains if few examples are similar enough to be
// averaged. They are visible as pops, especially where steps are played faster.
//
// - Rotations of a jolting joint are replaced with their Gaussian mean over time. The standard
//   deviation grows from 0 until the acceleration is within the limit, or up to 60 ms. It decreases
//   to 0 within 0.15 s of a jolt, so grid points further away from all jolts remain unchanged. The
//   first and the last point remain unchanged as well.
// - The children of a smoothed joint rotate with it. If they compensated its noise before, they may
//   jolt in the world afterwards, and are then smoothed as well.
// - The root and the legs are not smoothed, because they determine where feet stand. Fingers and
//   thumbs are not smoothed either (see RemoveJointNoise).
//
// Returns true if a joint was smoothed.
bool SmoothJolts(const Skeleton& skeleton, const GridLayout& layout, GridExample& example);

}  // namespace stridewire
