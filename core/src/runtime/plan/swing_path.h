#pragma once

#include <array>
#include <cstddef>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// A swinging foot is lifted by at most this.
inline constexpr double kMaxLiftM = 0.4;
/// Indices into FootTrajectory::lift_m.
inline constexpr std::size_t kEarlyLift = 0;
inline constexpr std::size_t kMiddleLift = 1;

/// Fractions of the swing at which clearance is checked, closest together where the foot passes the
/// edges of treads. Closer to its footprints, planting keeps the foot above their ground
/// (FootPlan::keeps_above_ground).
inline constexpr std::array<double, 20> kClearanceSamples{0.09, 0.13, 0.16, 0.19, 0.22, 0.25, 0.28,
                                                          0.32, 0.37, 0.43, 0.49, 0.55, 0.61, 0.66,
                                                          0.71, 0.76, 0.8,  0.84, 0.88, 0.91};

/// A value at each of kClearanceSamples.
using SwingValues = std::array<double, kClearanceSamples.size()>;

/// The sole of a swinging foot without lifts, at kClearanceSamples.
struct SwingSoles {
  /// Ball, heel and toe tip, minus their heights above the ground at rest.
  std::array<std::array<DVec3, 3>, kClearanceSamples.size()> points_m;
  SwingValues balls_m;  ///< Heights of the ball above its height at rest.
};

/// What is added to the path of a swinging foot.
struct SwingPath {
  std::array<double, 3> lift_m{};  ///< FootTrajectory::lift_m
  DVec3 advance_m = DVec3(0.0);    ///< FootTrajectory::aside_m
};

/// Chooses the lowest and flattest path with which the sole clears the ground. If it has to rise,
/// the foot also moves later or earlier toward its footprint, to pass the edge of a tread at a
/// better moment.
[[nodiscard]] SwingPath ChooseSwing(const SwingSoles& soles, const FootTrajectory& trajectory,
                                    const Terrain& terrain);

}  // namespace stridewire
