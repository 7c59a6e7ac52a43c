#pragma once

#include <array>

#include "stridewire/base/math.h"

namespace stridewire {

class MotionLibrary;

/// How a library walks when nobody says how far: from its examples.
struct LocomotionProfile {
  double step_m = 0.5;                  ///< Comfortable step ahead, foot to foot
  double longest_m = 0.6;               ///< Longest step ahead
  double back_m = 0.0;                  ///< Longest step back, as it is comfortable
  double width_m = 0.15;                ///< Between the feet of who walks straight on
  double stand_m = 0.2;                 ///< The same of the stand pose
  std::array<DVec3, 2> stand_feet_m{};  ///< Of the stand pose, from its base frame
};

/// Of a library whose groups and stand pose are there. MotionLibrary keeps it: locomotion_profile().
[[nodiscard]] LocomotionProfile MakeLocomotionProfile(const MotionLibrary& library);

}  // namespace stridewire
