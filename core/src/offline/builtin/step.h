#pragma once

#include <span>
#include <string>

#include "offline/builtin/figure.h"
#include "offline/builtin/step_shape.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// Returns the sideways distance between the balls of a standing figure, in metres.
[[nodiscard]] double StandWidthM();

/// Returns the shape of a straight step. The feet are `start_length_m` apart at its start and
/// `end_length_m` apart at its end.
[[nodiscard]] StepShape StraightShape(Foot moving, double start_length_m, double end_length_m);

/// Generates a step that starts at the origin with heading 0. The example stores the parameters
/// `names`.
[[nodiscard]] RawExample MakeStep(const Skeleton& figure, Foot moving, const StepShape& shape,
                                  std::span<const ParameterName> names, std::string source);

/// Returns the standing pose (the GaitState of length 0, gait_state.h), with the root at x = z = 0.
[[nodiscard]] FigurePose StandingPose();

}  // namespace stridewire::builtin
