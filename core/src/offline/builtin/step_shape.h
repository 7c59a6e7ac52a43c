#pragma once

#include "stridewire/base/math.h"

namespace stridewire::builtin {

/// Where the feet stand from each other at both ends of a step: the seven parameters of a general
/// step (paper, Section 6), ball to ball, metres and radians.
struct StepShape {
  DVec3 start_m =
      DVec3(0.0);            ///< Moving minus fixed foot in the heading frame of the start; z <= 0
  DVec3 end_m = DVec3(0.0);  ///< The same at the end, in the heading frame of the end; z >= 0
  double turn_rad = 0.0;     ///< Change of heading, left positive
  /// Whether the front foot lies flat in the middle of double support, as on stairs, so that heights
  /// between balls are those of the ground. On level ground its ball is still raised by 1 to 2 cm,
  /// which the y of a shape that is not flat leaves out.
  bool flat = false;
};

}  // namespace stridewire::builtin
