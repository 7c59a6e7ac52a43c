#pragma once

#include <vector>

#include "offline/capture/leg_finder.h"

namespace stridewire {

/// Returns the length of the bones from `top` down to `joint`, which is below it.
[[nodiscard]] double ChainLength(const std::vector<Joint>& joints, int top, int joint);

/// Finds hip and knee in a chain of at least three joints that ends with the ankle, and the toe
/// joint below the ankle.
[[nodiscard]] FoundLeg FindLegAboveAnkle(const FigureShape& figure, const std::vector<int>& chain);

/// Finds a leg in a chain of at least three joints that may end with the ankle or with toes. Joints
/// that bend divide the chain into segments. Thigh and shin are the two successive segments with
/// the largest total length.
[[nodiscard]] FoundLeg FindLegInChain(const FigureShape& figure, const std::vector<int>& chain);

}  // namespace stridewire
