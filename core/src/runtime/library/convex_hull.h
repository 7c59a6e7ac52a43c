#pragma once

#include <span>

namespace stridewire {

/// Finds the point closest to `target` [d] in the enlarged convex hull of `points` [count][d].
///
/// The hull is scaled about the mean of the points: a `growth` of 0.1 moves every point 10 %
/// further from the mean. Distances are measured after multiplying coordinate l by `metric[l]`.
/// Writes the point to `nearest` [d] and returns its distance from `target`, which is 0 inside the
/// hull.
///
/// d is at most kMaxParameters and `count` at most MotionLibrary::kMaxExamples. Uses Wolfe's
/// algorithm ("Finding the nearest point in a polytope", 1976) with at most 200 rounds. Uses 16 KB
/// of stack and never allocates.
double ProjectOntoHull(std::span<const double> points, std::span<const double> metric,
                       double growth, std::span<const double> target, std::span<double> nearest);

}  // namespace stridewire
