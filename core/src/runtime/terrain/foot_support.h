#pragma once

#include "stridewire/base/math.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// The rectangle from `heel_m` behind the ball of a foot to `toe_m` in front of it and `half_width_m` to
/// either side, all >= 0.
struct Sole {
  double heel_m = 0.0;
  double toe_m = 0.0;
  double half_width_m = 0.0;
};

/// How a sole would lie on the ground.
struct FootSupport {
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);  ///< Of the plane that fits best; unit, y > 0.
  double plane_height_m = 0.0;           ///< That plane's height at the ball.
  double ground_height_m = 0.0;          ///< HeightAt the ball.
  double gap_m = 0.0;    ///< Deepest the ground lies below the plane within the sole, >= 0.
  double rise_m = 0.0;   ///< Highest it lies above the plane within the sole, >= 0.
  double carried = 1.0;  ///< Share of the sole, 0 to 1, above the ground that the plane fits.
};

/// How a foot would lie whose ball is over (x, z) and whose heading is `heading_rad`. Its sole is looked at
/// in 10 x 5 points, corners and the ball among them. The plane fits (least squares) those points that are
/// reached from the ball without a rise or drop steeper than 45 degrees (5 mm are forgiven), so over an
/// edge it stays on the ball's side:
///
///            ball                 gap_m: the edge
///     =========o==------          carried: 0.7 of the sole
///   ‾‾‾‾‾‾‾‾‾‾‾‾‾‾|
///                 |_________
///
/// On a slope gap and rise are 0, on bumps both are small. All arguments are finite. Never allocates.
[[nodiscard]] FootSupport SupportOf(const Terrain& terrain, double x_m, double z_m,
                                    double heading_rad, const Sole& sole);

}  // namespace stridewire
