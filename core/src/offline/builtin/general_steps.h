#pragma once

#include "offline/builtin/figure.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

// Each function adds a group of left steps and a group of their mirror images to `library`. The
// comments list the parameters of the groups.

/// Parameters: start_z, end_z. Call it first, so that the groups of straight steps are the first of
/// the library.
void AddStraightSteps(RawLibrary& library);
void AddBackwardSteps(RawLibrary& library);  ///< Parameters: start_z, end_z.
void AddTurningSteps(RawLibrary& library);   ///< Parameters: start_x, start_z, end_z, turn.
void AddSideSteps(RawLibrary& library);      ///< Parameters: start_x, start_z, end_x, end_z.
/// Parameters: start_y, start_z, end_y, end_z, turn. Adds two groups of steps upward and two groups
/// of steps downward.
void AddClimbingSteps(RawLibrary& library);

}  // namespace stridewire::builtin
