#pragma once

#include <span>

namespace stridewire {

/// Nearest point to `target` [d] in the convex hull of `points` [count][d], grown about their mean
/// by `growth` (0.1: every point moved 10 % further out). Distances are taken after multiplying
/// parameter l by `metric[l]`. Writes `nearest` [d], returns the distance (0 inside).
///
/// Any d <= kMaxParameters. Wolfe's algorithm ("Finding the nearest point in a polytope", 1976) on a
/// corral of at most d + 1 points; at most 200 rounds. At most
/// MotionLibrary::kMaxExamples points, 56 bytes of stack each. Never allocates.
double ProjectOntoHull(std::span<const double> points, std::span<const double> metric,
                       double growth, std::span<const double> target, std::span<double> nearest);

}  // namespace stridewire
