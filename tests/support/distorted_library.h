#pragma once

#include <cstdint>
#include <memory>
#include <random>

#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// A library of one group, left steps with `parameter_count` (1 to 7) parameters: end_z, start_z, turn,
/// end_x, start_x, end_y, start_y in this order. Examples, at random places (`seed`), have their
/// parameters exactly; between them rotations of legs with knees are blended, so that a(p) is not p, the
/// less the larger `reach_m`, how far feet come apart forward (up to 0.7). Aborts if the builder
/// refuses.
[[nodiscard]] std::shared_ptr<const MotionLibrary> MakeDistortedLibrary(int parameter_count,
                                                                        int example_count,
                                                                        double reach_m,
                                                                        std::uint32_t seed);

/// A point in the hull of a group's examples: their mean with random weights, a few of them large.
[[nodiscard]] ParameterValues PointInHull(const MotionGroup& group, std::mt19937& random);

}  // namespace stridewire
