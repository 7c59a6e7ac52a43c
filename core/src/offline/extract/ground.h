#pragma once

#include "offline/extract/contacts.h"

namespace stridewire {

/// The floor of a capture and the resting heights of the feet.
struct Ground {
  double floor_m = 0.0;                  ///< Height of the floor in the capture.
  double ball_height_m[2] = {0.0, 0.0};  ///< Height of resting balls above the floor, by foot.
  bool single_floor = true;
  bool has_contacts = false;

  /// Returns the height of the ground below a foot with this resting height of its ball. On a
  /// single floor the result is within 1.5 cm of the floor, since recordings tilt by about 1 cm per
  /// 3 m. Larger differences come from feet that never lay flat.
  [[nodiscard]] double Below(Foot foot, double ball_height_in_capture_m) const;
};

/// Estimates the ground. Floors near y = 0 are assumed to be at 0; other floors are assumed to be
/// 4 cm below the resting balls.
[[nodiscard]] Ground FindGround(const FootContacts& contacts);

}  // namespace stridewire
