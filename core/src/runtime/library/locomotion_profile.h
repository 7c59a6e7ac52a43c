#pragma once

#include <array>

#include "stridewire/base/math.h"

namespace stridewire {

class MotionLibrary;

/// Typical steps of a library, derived from its examples. Walks use them unless the request says
/// otherwise.
struct LocomotionProfile {
  double step_m = 0.5;     ///< Comfortable step forward, from foot to foot.
  double longest_m = 0.6;  ///< Longest step forward.
  double back_m = 0.0;     ///< Longest comfortable step backward.
  double width_m = 0.15;   ///< Sideways distance between the feet in a straight walk.
  double stand_m = 0.2;    ///< Sideways distance between the feet in the stand pose.
  /// [foot]: position of the foot in the stand pose, relative to the base frame.
  std::array<DVec3, 2> stand_feet_m{};
};

/// Derives the profile of a library whose groups and stand pose are loaded. MotionLibrary stores
/// it.
[[nodiscard]] LocomotionProfile MakeLocomotionProfile(const MotionLibrary& library);

}  // namespace stridewire
