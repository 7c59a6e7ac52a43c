#pragma once

#include "offline/builtin/figure.h"
#include "offline/builtin/foot_path.h"

namespace stridewire::builtin {

/// Distance from hip to ankle with the knee bent by that angle (0: straight), metres.
[[nodiscard]] double ReachAtKnee(double knee_rad);

/// Turns hip, knee, ankle and toe joint of one leg so that the foot is at `place`. The knee is a
/// hinge about its x axis and points where the foot does, or half-way between the foot and
/// `heading_rad` where the body has turned over it. Out of reach the leg is all but straight
/// and the foot falls short.
void SolveLeg(Foot foot, const FootPlace& place, FigurePose& pose, double heading_rad = 0.0);

}  // namespace stridewire::builtin
