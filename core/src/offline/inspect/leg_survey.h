#pragma once

#include <optional>

#include "stridewire/offline/synthesis.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Largest deviations of the legs in one or several clips.
struct LegDeviations {
  /// Angle in degrees between the direction in which a knee bends and the direction of its foot.
  /// nullopt if no angle could be measured.
  std::optional<double> knee_deg;
  double hover_m = 0.0;  ///< Height of a standing sole above the ground.
  double sink_m = 0.0;   ///< Depth of the ball of a foot below the ground.
  int feet = 0;          ///< Number of measured feet, one per leg and frame.
};

/// Measures the knees and soles of a synthesis on level ground at y = 0. Updates the maxima in
/// `deviations` and adds the number of measured feet.
///
/// - The knee angle is measured in the plane perpendicular to the line from hip to ankle. It is the
///   angle between the offset of the knee from this line and the vector from ankle to ball. If the
///   foot points downward, as in a swing, its direction in this plane is uncertain, so the knee may
///   also point in the forward direction of the pelvis. Legs that are bent by less than about 20
///   degrees, and feet that are nearly parallel to the line, are ignored.
/// - Heights are relative to the stand pose. The depth of a sole is measured at the ball of the
///   foot, because skeletons have no heel joint, and toe tips dip several centimetres below the
///   ground even in captures.
/// - The height of a standing sole is that of the lowest of heel, ball and toe tip, so that a foot
///   may roll over its heel and its toes. If `has_stand` is false, the stand pose is a pose in
///   mid-stride, in which heels and toes are not on the ground. In this case, a standing foot
///   hovers only if its ball is never on the ground while the foot stands.
void SurveyLegs(const MotionLibrary& library, const Synthesis& synthesis, bool has_stand,
                LegDeviations& deviations);

}  // namespace stridewire
