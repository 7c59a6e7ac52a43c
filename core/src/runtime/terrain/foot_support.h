#pragma once

#include "stridewire/base/math.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// The sole of a foot: a rectangle from `heel_m` behind the ball to `toe_m` in front of it and
/// `half_width_m` to either side. All are >= 0.
struct Sole {
  double heel_m = 0.0;
  double toe_m = 0.0;
  double half_width_m = 0.0;
};

/// Support of a sole by the ground.
struct FootSupport {
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);  ///< Normal of the best-fitting plane; unit, y > 0.
  double plane_height_m = 0.0;           ///< Height of that plane at the ball.
  double ground_height_m = 0.0;          ///< Terrain::HeightAt the ball.
  double gap_m = 0.0;    ///< Maximum depth of the ground below the plane within the sole, >= 0.
  double rise_m = 0.0;   ///< Maximum height of the ground above the plane within the sole, >= 0.
  double carried = 1.0;  ///< Fraction of the sole's points to which the plane is fitted, 0 to 1.
};

/// Computes the support of a foot whose ball is above (x, z) and whose heading is `heading_rad`.
/// The sole is sampled at 10 x 5 points, including its corners and the ball. The plane is fitted by
/// least squares to the points that can be reached from the ball without a rise or drop steeper
/// than 45 degrees, with a tolerance of 5 mm. At an edge, the plane stays on the ball's side:
///
///          ball                 gap_m: height of the edge
///   =========o==------          carried: 0.7
///   ~~~~~~~~~~~~|
///               |_________
///
/// On a slope, gap and rise are 0; on bumps both are small. All arguments must be finite. Never
/// allocates.
[[nodiscard]] FootSupport SupportOf(const Terrain& terrain, double x_m, double z_m,
                                    double heading_rad, const Sole& sole);

}  // namespace stridewire
