#pragma once

#include <array>

#include "stridewire/base/math.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

class MotionLibrary;

/// The feet of an avatar are apart if the forward distance between them differs from that of the
/// stand pose by more than this.
inline constexpr double kFeetApartForwardM = 0.12;

/// Typical steps of a library, derived from its examples. Walks use them unless the request
/// specifies other values.
struct LocomotionProfile {
  double step_m = 0.5;     ///< Comfortable length of a step forward, from foot to foot.
  double longest_m = 0.6;  ///< Maximum length of a step forward.
  /// Length of the shortest forward step that either foot can take, at most step_m. 0 if each foot
  /// can step beside the other.
  double shortest_m = 0.0;
  double back_m = 0.0;    ///< Maximum comfortable length of a step backward.
  double width_m = 0.15;  ///< Sideways distance between the feet in a straight walk.
  double stand_m = 0.2;   ///< Sideways distance between the feet in the stand pose.
  /// [foot]: position of the foot in the stand pose, relative to the base frame.
  std::array<DVec3, 2> stand_feet_m{};
  /// True if one foot of the stand pose is more than kFeetApartForwardM ahead of the other, because
  /// the captures contain no stand. A walk then begins and ends in a stride.
  bool stands_in_stride = false;
  bool has_climbs = false;  ///< True if a group of steps has the parameter end_y.

  /// Returns the rear foot of the stand pose.
  [[nodiscard]] Foot RearFoot() const {
    return stand_feet_m[0].z <= stand_feet_m[1].z ? Foot::kLeft : Foot::kRight;
  }
};

/// Derives the profile of a library whose groups and stand pose are loaded. MotionLibrary stores
/// it.
[[nodiscard]] LocomotionProfile MakeLocomotionProfile(const MotionLibrary& library);

}  // namespace stridewire
