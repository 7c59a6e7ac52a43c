#pragma once

#include <array>

#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

/// Toe tips may stay this far below the height at which they rest on the ground. If they were
/// raised to that height, toes would hover in blends of steps whose resting toes differ.
inline constexpr double kMaxToeSinkM = 0.005;

/// If the toe tip of a foot is lower than `height_m` in the frame of the pose, bends the toes
/// upward until it is at that height, or by 60 degrees if that is less. Does nothing if the foot
/// has no toe joint.
void RaiseToeTip(const Skeleton& skeleton, const LegRig& rig, Foot foot, double height_m,
                 PoseSpan pose);

/// Bends the toes in captured steps and jumps upward where their tips are in the ground.
///
/// When people push off, their toes stay on the ground and bend by up to 60 degrees. Captured toes
/// often bend less, because their markers are close together and shift in the shoe, so the tips
/// sink by 2 to 5 cm. If planting had to lift them out of the ground, the whole foot would rise and
/// the knee would bend further than in the capture. FeetLeveller must have corrected the heights of
/// standing feet before. `ball_height_m` [foot] is the height of a ball that rests on level ground.
///
/// Does nothing if planting does not support the legs (LegRig::is_usable).
void BendToes(const LegRig& rig, const std::array<double, 2>& ball_height_m, RawLibrary& library);

}  // namespace stridewire
