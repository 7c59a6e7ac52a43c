#pragma once

#include <span>
#include <string>

#include "offline/builtin/figure.h"
#include "offline/builtin/step_shape.h"
#include "stridewire/offline/raw_library.h"
#include "offline/builtin/upper_body.h"

namespace stridewire::builtin {

/// How far apart the balls of a standing figure are, metres.
[[nodiscard]] double NaturalSide();

/// The step from feet `start_length_m` apart to `end_length_m`, straight ahead.
[[nodiscard]] StepShape StraightShape(Foot moving, double start_length_m, double end_length_m);

/// The step of that shape, normalised, with parameters `names`.
[[nodiscard]] RawExample MakeStep(const Skeleton& figure, Foot moving, const StepShape& shape,
                                  std::span<const ParameterName> names, std::string source);

/// Standing still: the state of length 0, with the root at x = z = 0.
[[nodiscard]] FigurePose StandingPose();

/// Arms, trunk and head of someone standing.
[[nodiscard]] UpperBody StandingUpperBody();

}  // namespace stridewire::builtin
