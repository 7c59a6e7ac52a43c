#pragma once

#include <span>

#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Returns a(p): the actual parameters of a movement, measured on the first and last pose of the
/// blend (paper, Section 4), in the order of its group. For steps, these are the foot vectors in
/// the heading frames of start and end, and the heading change. For jumps, they are the forward and
/// upward displacement of the midpoint between the balls, and the heading change. `pose` is scratch
/// memory with one rotation per joint. Never allocates.
[[nodiscard]] ParameterValues MeasureMovement(const MotionLibrary& library,
                                              const Movement& movement, GridCache& cache,
                                              PoseSpan pose);

/// Measures a movement of a group that is not part of a library yet.
[[nodiscard]] ParameterValues MeasureMovement(const Skeleton& skeleton, const GridLayout& layout,
                                              const MotionGroup& group, const Movement& movement,
                                              GridCache& cache, PoseSpan pose);

/// Returns the largest difference between two parameter vectors of a group, in metres. A radian
/// counts as kMetresPerRadian. For p and the measured parameters a(p), this is the paper's
/// interpolation error e(p) = |p - a(p)|.
[[nodiscard]] double LargestDifference(const MotionGroup& group, const ParameterValues& a,
                                       const ParameterValues& b);

/// Converts angles to metres where parameters of both kinds are compared.
inline constexpr double kMetresPerRadian = 0.5;

}  // namespace stridewire
