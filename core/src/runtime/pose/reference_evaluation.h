#pragma once

#include "runtime/movement/movement.h"

namespace stridewire {

/// EvaluateMovement without vectors, cache or batches, as the paper has it (Eq. (2), (3) and (5)): the four grid
/// poses around the time are blended anew, then interpolated. For tests, which hold the fast evaluation to it (1e-5 m
/// and rad; its sums are the same, its trigonometry is not), and for measurements. Allocates.
void EvaluateMovementByReference(const MotionGroup& group, const GridLayout& layout,
                                 const Movement& movement, double time_s, PoseSpan out);

/// The same the way animation programs commonly do: every example is sampled at the time itself, unless its weight is
/// 0, and the poses are blended.
void EvaluateMovementBySampling(const MotionGroup& group, const GridLayout& layout,
                                const Movement& movement, double time_s, PoseSpan out);

}  // namespace stridewire
