#pragma once

#include <cstddef>

namespace stridewire::protocol {

/// The magnitude of the three smaller components of a unit quaternion is at most 1 / sqrt(2). This
/// factor scales them to the range -1 to 1.
inline constexpr float kSqrt2 = 1.41421356237309505f;
/// kKept[i] are the components that are stored if component i is dropped.
inline constexpr std::size_t kKept[4][3] = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}};

}  // namespace stridewire::protocol
