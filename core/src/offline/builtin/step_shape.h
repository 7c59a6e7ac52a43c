#pragma once

#include "stridewire/base/math.h"

namespace stridewire::builtin {

/// Style of a step: how the feet roll over the ground and how fast the body moves.
enum class StepStyle {
  kStraight,
  /// Turning and sideways steps. The heel rises more slowly than in straight steps, because few
  /// examples must cover many parameters, and blends of fast motion are less accurate.
  kGeneral,
  /// Steps with height differences. They are slower. In the middle of double support the front foot
  /// is flat, so the height difference of the balls is that of the ground. In the other styles, the
  /// front ball is raised by 1 to 2 cm, which `StepShape::start_m.y` and `end_m.y` do not include.
  kStairs,
};

/// Relative positions of the feet at both ends of a step: the seven parameters of a general step
/// (paper, Section 6). Measured from ball to ball, in metres and radians.
struct StepShape {
  /// Vector from the fixed to the moving foot at the start, in the heading frame of the start; z <=
  /// 0.
  DVec3 start_m = DVec3(0.0);
  /// Vector from the fixed to the moving foot at the end, in the heading frame of the end; z >= 0.
  DVec3 end_m = DVec3(0.0);
  double turn_rad = 0.0;  ///< Change of heading; positive is left.
  StepStyle style = StepStyle::kStraight;
};

}  // namespace stridewire::builtin
