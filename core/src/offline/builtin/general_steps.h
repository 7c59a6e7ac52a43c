#pragma once

#include "offline/builtin/figure.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// Each function adds a group of left steps and one of their mirror images to `library`.
void AddStraightSteps(RawLibrary& library);  ///< start_z, end_z; must be added first.
void AddBackwardSteps(RawLibrary& library);  ///< start_z, end_z
void AddTurningSteps(RawLibrary& library);   ///< start_x, start_z, end_z, turn
void AddSideSteps(RawLibrary& library);      ///< start_x, start_z, end_x, end_z
/// start_y, start_z, end_y, end_z, turn. Adds two groups upwards and two downwards.
void AddClimbingSteps(RawLibrary& library);

}  // namespace stridewire::builtin
