#pragma once

#include <array>
#include <cstddef>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// Maximum of each entry of FootTrajectory::lift_m. The curves of the three lifts overlap, so the
/// foot can rise further than this.
inline constexpr double kMaxLiftM = 0.4;
/// Indices into FootTrajectory::lift_m.
inline constexpr std::size_t kEarlyLift = 0;
inline constexpr std::size_t kMiddleLift = 1;
inline constexpr std::size_t kLateLift = 2;

/// Fractions of the swing at which ChooseSwing checks the clearance of the foot. They are densest
/// where the foot passes the edges of treads. Before the first and after the last of them, planting
/// keeps the foot above the ground of its footprints (FootPlan::keeps_above_ground).
inline constexpr std::array<double, 20> kClearanceSamples{0.09, 0.13, 0.16, 0.19, 0.22, 0.25, 0.28,
                                                          0.32, 0.37, 0.43, 0.49, 0.55, 0.61, 0.66,
                                                          0.71, 0.76, 0.8,  0.84, 0.88, 0.91};

/// [index in kClearanceSamples]: a value at that fraction of the swing.
using SwingValues = std::array<double, kClearanceSamples.size()>;

/// The sole of a swinging foot during a swing whose lifts are zero.
struct SwingSoles {
  /// [index in kClearanceSamples]: positions of ball, heel and toe tip in world space. From each
  /// height, the height of the point in a flat, standing foot has been subtracted.
  std::array<std::array<DVec3, 3>, kClearanceSamples.size()> points_m;
  SwingValues balls_m;  ///< Heights of the balls in `points_m`.
};

/// Members of a FootTrajectory that move a swinging foot over obstacles.
struct SwingPath {
  std::array<double, 3> lift_m{};
  DVec3 mid_swing_offset_m = DVec3(0.0);
};

/// Returns the lowest and flattest path on which the sole clears the ground. If the foot has to
/// rise, the path may also shift it by up to 0.12 m forward or backward in the middle of the swing.
/// The foot then passes the edge of a tread earlier or later, at a time at which it is higher.
[[nodiscard]] SwingPath ChooseSwing(const SwingSoles& soles, const FootTrajectory& trajectory,
                                    const Terrain& terrain);

}  // namespace stridewire
