#pragma once

#include <cstddef>

#include "runtime/movement/stride_variation.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Groups with more parameters than this have no variants, because their captured steps rarely have
/// similar parameters. Groups of steps with at most two parameters contain only straight steps.
inline constexpr std::size_t kMaxVariantParameters = 2;

/// A variant that a step blends (see MotionGroup).
struct VariantShare {
  int variant = -1;     ///< Index in the group, or -1: none.
  double weight = 0.0;  ///< Weight of the variant, 0 to 1.
};

/// Chooses a variant at random for a step with the parameters `wanted`. The nearer the parameters
/// of a variant are, the more likely it is chosen and the larger is its weight. Variants whose
/// parameters differ by 0.5 m or more are never chosen: the individual variation of a long stride
/// would not fit a start.
[[nodiscard]] VariantShare ChooseVariant(const MotionGroup& group, const ParameterValues& wanted,
                                         const StrideVariation& variation);

}  // namespace stridewire
