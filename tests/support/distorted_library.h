#pragma once

#include <cstdint>
#include <memory>
#include <random>

#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Returns a library with one group of left steps with `parameter_count` parameters (1 to 7), in
/// the order end_z, start_z, turn, end_x, start_x, end_y, start_y. The examples have random
/// parameters, which depend on `seed`, and meet them exactly. Between examples, blending the
/// rotations of bent legs makes the parameters a(p) of the movement differ from the requested p.
/// The difference grows with `reach_m`, the largest forward distance between the feet, which is at
/// most 0.7. Aborts on failure.
[[nodiscard]] std::shared_ptr<const MotionLibrary> MakeDistortedLibrary(int parameter_count,
                                                                        int example_count,
                                                                        double reach_m,
                                                                        std::uint32_t seed);

/// Returns a point in the hull of the examples of a group: a mean with random weights, a few of
/// them large.
[[nodiscard]] ParameterValues PointInHull(const MotionGroup& group, std::mt19937& random);

}  // namespace stridewire
