#pragma once

#include <optional>

#include "stridewire/offline/synthesis.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Largest deviations of the legs over some clips.
struct LegDeviations {
  /// Angle between the direction in which a knee bends and the direction of its foot, degrees.
  /// Empty if no leg is ever bent.
  std::optional<double> knee_deg;
  double hover_m = 0.0;  ///< Height of a standing sole above level ground.
  double sink_m = 0.0;   ///< Depth of any ball of a foot below level ground.
  int feet = 0;          ///< Number of feet measured, one per leg and frame.
};

/// Measures knees and soles of a synthesis on level ground at y = 0. Extends `deviations`.
///
/// - The direction of a knee is that from the line between hip and ankle to the knee. It is
///   compared with that from ankle to ball, both seen along that line. If the foot points downward,
///   as in a swing, its direction is uncertain. Then the knee may also follow the pelvis. Legs that
///   are bent by less than about 20 degrees have no direction.
/// - Heights are relative to the stand pose. The depth of a sole is measured at the ball of the
///   foot. Skeletons have no heel joint, and their toe tips dip several centimetres below the
///   ground even in captures.
/// - The height of a standing sole is that of the lowest of heel, ball and tip of the toes, so that
///   a foot may roll over its heel and its toes. If `has_stand` is false, the stand pose is a
///   moment in mid-stride, in which heels and toes are not on the ground. Then a standing foot
///   hovers only if its ball never comes down while it stands.
void SurveyLegs(const MotionLibrary& library, const Synthesis& synthesis, bool has_stand,
                LegDeviations& deviations);

}  // namespace stridewire
