#pragma once

#include <cstddef>

namespace stridewire::protocol {

/// Writes `count` quaternions (x y z w, one behind the other) as the "smallest three" of pose_codec.h, 6 bytes each.
/// Returns the index of the first that is not of unit length within kUnitTolerance, or `count`; from there on what was
/// written is unspecified. Vectors of any width (Google Highway) give the same bytes.
[[nodiscard]] std::size_t QuantiseRotations(const float* quaternions, std::size_t count,
                                            std::byte* out);

}  // namespace stridewire::protocol
