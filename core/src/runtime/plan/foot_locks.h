#pragma once

#include <array>

#include "runtime/movement/movement.h"
#include "runtime/skeleton/leg_rig.h"
#include "runtime/terrain/foot_support.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// Position and heading of a foot that stands between two movements, and the corrections that
/// planting adds to the blended foot at that time.
struct FootLock {
  Footprint print;                       ///< Where the foot stands, in world space.
  double height_m = 0.0;                 ///< Height that is added to the blended foot.
  double turn_rad = 0.0;                 ///< Turn that is added to the blended foot.
  Vec3 normal = Vec3(0.0f, 1.0f, 0.0f);  ///< Normal of the ground below the foot.
  double root_weight = 0.5;              ///< FootTrajectory::root_weight
};
using FootLocks = std::array<FootLock, 2>;  ///< [foot]

/// Locks the feet at their positions in an unplanted pose, on the ground below them. Without
/// terrain, the ground is at height `ground_m`.
[[nodiscard]] FootLocks FootLocksOf(const Skeleton& skeleton, const LegRig& rig, ConstPoseSpan pose,
                                    double ground_m, const Terrain* terrain);

[[nodiscard]] Sole SoleOf(const LegRig::Side& side);

/// Returns how the ground would support a foot on a footprint.
[[nodiscard]] FootSupport SupportOf(const Terrain& terrain, const LegRig::Side& side,
                                    const Footprint& print);

/// Replaces the time warp and the foot plan of `movement` so that both feet stay locked.
void StandOn(const FootLocks& locks, Movement& movement);

/// Returns the foot locks of a planned movement at `time_s`. Both feet must stand at that time.
/// `pose` is the blended pose at that time, including its difference pose.
[[nodiscard]] FootLocks FootLocksAt(const MotionLibrary& library, const Movement& movement,
                                    double time_s, ConstPoseSpan pose);

/// Returns the additional height of the ball's centre above the ground on a slope. The centre has a
/// fixed distance from the ground plane, so its vertical distance increases with the slope.
[[nodiscard]] double SlopeRise(const LegRig::Side& side, const Vec3& normal);

/// Sets the height and the ground normal at the landing of a trajectory to those of the terrain. If
/// the ground ahead rises steeply, chooses a flatter normal and a higher landing, so that the foot
/// stands on its toes.
void LandOnGround(const Terrain& terrain, const LegRig::Side& side, FootTrajectory& trajectory);

}  // namespace stridewire
