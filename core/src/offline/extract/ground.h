#pragma once

#include "offline/extract/contacts.h"

namespace stridewire {

/// Resting heights of the feet, from which the height of the ground below each contact is computed.
/// Different contacts may be on ground of different heights.
struct Ground {
  double ball_height_m[2] = {0.0, 0.0};  ///< [foot]: height of the resting ball above the ground.
  bool has_contacts = false;

  /// Returns the height of the ground below a foot whose ball rests at this height.
  [[nodiscard]] double Below(Foot foot, double ball_height_in_capture_m) const {
    return ball_height_in_capture_m - ball_height_m[static_cast<int>(foot)];
  }
};

/// Estimates the resting heights of the feet. If many balls rest 1 to 9 cm above y = 0, the ground
/// there is assumed to be at 0. Otherwise balls are assumed to rest 4 cm above the ground.
[[nodiscard]] Ground FindGround(const FootContacts& contacts);

}  // namespace stridewire
