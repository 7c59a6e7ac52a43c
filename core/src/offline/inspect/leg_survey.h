#pragma once

#include <optional>

#include "stridewire/offline/synthesis.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Largest deviations of the legs in one or several clips.
struct LegDeviations {
  /// Angle in degrees between the direction in which a knee bends and the direction of its foot.
  /// nullopt if no leg is ever bent.
  std::optional<double> knee_deg;
  double hover_m = 0.0;  ///< Height of a standing sole above the ground.
  double sink_m = 0.0;   ///< Depth of the ball of a foot below the ground.
  int feet = 0;          ///< Number of measured feet, one per leg and frame.
};

/// Measures knees and soles of a synthesis on level ground at y = 0. Increases `deviations` where
/// necessary.
///
/// - The direction of a knee points from the line between hip and ankle to the knee. The direction
///   of a foot points from ankle to ball. Both are compared as seen along that line. If the foot
///   points downward, as in a swing, its direction is uncertain, so the knee may also point in the
///   direction of the pelvis. Legs that are bent by less than about 20 degrees have no direction.
/// - Heights are relative to the stand pose. The depth of a sole is measured at the ball of the
///   foot. Skeletons have no heel joint, and even in captures their toe tips dip several
///   centimetres below the ground.
/// - The height of a standing sole is that of the lowest of heel, ball and toe tip, so that a foot
///   may roll over its heel and its toes. If `has_stand` is false, the stand pose is a pose in
///   mid-stride, in which heels and toes are not on the ground. In this case, a standing foot
///   hovers only if its ball is never on the ground while the foot stands.
void SurveyLegs(const MotionLibrary& library, const Synthesis& synthesis, bool has_stand,
                LegDeviations& deviations);

}  // namespace stridewire
