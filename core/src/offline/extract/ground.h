#pragma once

#include "offline/extract/contacts.h"

namespace stridewire {

/// The floor of a capture and what stands above it.
struct Ground {
  double floor_m = 0.0;                  ///< Height of the floor in the capture
  double ball_height_m[2] = {0.0, 0.0};  ///< Resting balls above the floor (by foot)
  bool single_floor = true;
  bool has_contacts = false;

  /// Height of the ground below a foot of that resting ball height. On a single floor it departs
  /// from it by little (recordings tilt by about 1 cm in 3 m); more is a foot that never lay flat.
  [[nodiscard]] double Below(Foot foot, double ball_height_in_capture_m) const;
};

/// Floors near y = 0 are taken to be there; others where balls rest 4 cm above them.
[[nodiscard]] Ground FindGround(const FootContacts& contacts);

}  // namespace stridewire
