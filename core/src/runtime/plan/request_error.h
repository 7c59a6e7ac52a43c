#pragma once

#include "runtime/plan/request_plan.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Conditions at the landing of a planned movement.
struct LandingConditions {
  /// True if planting corrects where feet land and how far the body turns.
  bool plants_feet = true;
  bool has_terrain = false;  ///< True if the terrain determines the height of the landing place.
};

/// The predicted result of a planned step or jump, and its difference from the request.
struct RequestError {
  RequestTarget reached;    ///< Result of the step or jump, in the form of its target.
  double distance_m = 0.0;  ///< Distance between the requested and the reached place, >= 0.
  /// The larger of two angles: between the paths to these places, and between the headings there;
  /// >= 0. Paths are compared only if the places differ and are not close to the start.
  double angle_rad = 0.0;

  [[nodiscard]] bool IsTooLarge() const {
    return distance_m > kMaxRequestErrorM || angle_rad > kMaxRequestErrorRad;
  }
};

/// Predicts the result of a plan from its parameters, with an error of a few centimetres. `feet`
/// are the feet at the start.
[[nodiscard]] RequestError ErrorOf(const MotionLibrary& library, const RequestPlan& plan,
                                   const FootState& feet, const LandingConditions& conditions);

/// Returns the angle between two horizontal paths, at most pi. Returns 0 if the requested path is
/// so short that its direction does not matter, or if `path` ends close to its start.
[[nodiscard]] double DirectionError(const DVec3& requested, const DVec3& path);

}  // namespace stridewire
