#pragma once

#include "figure.h"
#include "stridewire/offline/raw_library.h"
#include "upper_body.h"

namespace stridewire::builtin {

/// The step from feet `start_length_m` apart to `end_length_m` (not both 0), normalised.
[[nodiscard]] RawExample MakeStep(const Skeleton& figure, Foot moving, double start_length_m,
                                  double end_length_m);

/// Standing still: the state of length 0, with the root at x = z = 0.
[[nodiscard]] FigurePose StandingPose();

/// Arms, trunk and head of someone standing.
[[nodiscard]] UpperBody StandingUpperBody();

}  // namespace stridewire::builtin
