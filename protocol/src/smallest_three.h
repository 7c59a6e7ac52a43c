#pragma once

#include <cstddef>

namespace stridewire::protocol {

/// What both codecs of the smallest three components share.
inline constexpr float kSqrt2 = 1.41421356237309505f;
/// The components that stay when one is left out.
inline constexpr std::size_t kStaying[4][3] = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}};

}  // namespace stridewire::protocol
