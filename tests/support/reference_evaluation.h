#pragma once

#include "runtime/movement/movement.h"

namespace stridewire {

/// EvaluateMovement without SIMD, cache or batches, as the paper defines it (Eq. (2), (3) and (5)).
/// It blends the four grid poses around the time and interpolates between them. Tests and
/// benchmarks compare the fast evaluation with it, to within 1e-5 m and rad; the trigonometry
/// differs. Allocates.
void EvaluateMovementByReference(const MotionGroup& group, const GridLayout& layout,
                                 const Movement& movement, double time_s, PoseSpan out);

/// EvaluateMovement the way animation systems commonly do it: samples every example with a nonzero
/// weight at the given time and blends the sampled poses. Allocates.
void EvaluateMovementBySampling(const MotionGroup& group, const GridLayout& layout,
                                const Movement& movement, double time_s, PoseSpan out);

/// PlantFeet without SIMD, in double precision. PlantFeet is within 2e-5 m and 2e-4 rad of it.
void PlantFeetByReference(const Skeleton& skeleton, const LegRig& rig, const Movement& movement,
                          double time_s, PoseSpan pose);

}  // namespace stridewire
