#pragma once

#include "stridewire/base/math.h"

namespace stridewire {

/// A place a foot stands on: a point of the ground below the ball of the foot.
struct Footprint {
  DVec3 position_m = DVec3(0.0);
  double heading_rad = 0.0;  ///< Of the foot, less the toe-out the skeleton stands with.
};

}  // namespace stridewire
