#pragma once

#include <vector>

#include "offline/capture/leg_finder.h"

namespace stridewire {

/// Returns the length of the bones from `top` down to `joint`, which is below it.
[[nodiscard]] double ChainLength(const std::vector<Joint>& joints, int top, int joint);

/// Finds hip and knee in a chain of at least three joints that ends with the ankle, and the toe
/// joint below it.
[[nodiscard]] FoundLeg FindLegAboveAnkle(const FigureShape& figure, const std::vector<int>& chain);

/// Finds a leg in a chain of at least three joints that may end with the ankle or with toes. Thigh
/// and shin are the longest pair of successive segments.
[[nodiscard]] FoundLeg FindLegInChain(const FigureShape& figure, const std::vector<int>& chain);

}  // namespace stridewire
