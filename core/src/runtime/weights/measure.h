#pragma once

#include <span>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/movement_request.h"
#include "runtime/pose/evaluate_poses.h"

namespace stridewire {

/// a(p): a movement's own parameters, measured on the first and last pose of the blend (paper,
/// Section 4), in the order of its group. Steps: foot vectors in the heading frames of start and
/// end, and the heading change. Jumps: how far the centre between the balls goes forward and up.
/// `pose` is scratch with one rotation a joint. Never allocates.
[[nodiscard]] ParameterValues MeasureMovement(const MotionLibrary& library,
                                              const Movement& movement, GridCache& cache,
                                              PoseSpan pose);

/// The same of a group that is in no library yet.
[[nodiscard]] ParameterValues MeasureMovement(const Skeleton& skeleton, const GridLayout& layout,
                                              const MotionGroup& group, const Movement& movement,
                                              GridCache& cache, PoseSpan pose);

/// Largest difference of two parameter vectors of a group, metres; a radian counts
/// kMetresPerRadian. The norm of the paper's interpolation error e(p) = |p - a(p)|.
[[nodiscard]] double LargestDifference(const MotionGroup& group, const ParameterValues& a,
                                       const ParameterValues& b);

inline constexpr double kMetresPerRadian = 0.5;

}  // namespace stridewire
