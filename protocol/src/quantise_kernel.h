#pragma once

#include <cstddef>

namespace stridewire::protocol {

/// Encodes `count` quaternions (x, y, z, w each) as "smallest three" (pose_codec.h), 6 bytes per
/// quaternion. Stops at the first quaternion whose length deviates from 1 by more than
/// kUnitTolerance and returns its index, or returns `count`. Bytes from that index on are
/// unspecified. The bytes do not depend on the vector width of the machine.
[[nodiscard]] std::size_t QuantiseRotations(const float* quaternions, std::size_t count,
                                            std::byte* out);

}  // namespace stridewire::protocol
