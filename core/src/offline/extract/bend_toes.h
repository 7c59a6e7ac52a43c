#pragma once

#include <array>

#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

/// Bent toes may be this far in the ground. Otherwise toes would hover in blends of steps whose
/// toes differ.
inline constexpr double kMaxToeSinkM = 0.005;

/// Bends the toes of a foot upward so that their tip is at least at a height in the frame of the
/// pose, if a bend of 60 degrees is sufficient for that. Does nothing if the foot has no toe joint.
void RaiseToeTip(const Skeleton& skeleton, const LegRig& rig, Foot foot, double height_m,
                 PoseSpan pose);

/// Bends the toes of captured steps and jumps upward where their tips are in the ground.
///
/// When people push off, their toes stay on the ground and bend by up to 60 degrees. Captured toes
/// often bend less, because their markers are close together and shift in the shoe, so the tips
/// sink by 2 to 5 cm. If planting had to lift them out of the ground, the whole foot would rise and
/// the knee would bend further than in the capture. The heights of standing feet have been
/// corrected before (FeetLeveller). `ball_height_m` [foot] is the height at which balls rest.
///
/// Does nothing if planting does not support the legs.
void BendToes(const LegRig& rig, const std::array<double, 2>& ball_height_m, RawLibrary& library);

}  // namespace stridewire
