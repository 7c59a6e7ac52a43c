#pragma once

#include <span>

#include "stridewire/runtime/movement.h"

namespace stridewire {

/// One pose that is wanted of a movement of the library's. Poses have one rotation a joint.
struct PoseJob {
  const Movement* movement = nullptr;  ///< Its feet, if planted, packed (FootPlan::packed)
  double time_s = 0.0;                 ///< Clamped to the movement
  GridCache* cache = nullptr;          ///< The movement's own: no two jobs share one
  Pose* shown = nullptr;               ///< With the feet planted
  Pose* blended = nullptr;             ///< What EvaluateMovement gives, for who needs that too
};

/// Evaluates poses together: blends them one after the other and plants as many at a time as vectors have lanes. A
/// pose is the same bytes whatever it is evaluated with. Never allocates.
void EvaluatePoses(const MotionLibrary& library, std::span<const PoseJob> jobs);

}  // namespace stridewire
