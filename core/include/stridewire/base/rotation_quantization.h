#pragma once

#include <array>
#include <cstdint>

#include "stridewire/base/math.h"

namespace stridewire {

/// Describes how the rotation q of one joint is quantized. Let d = conj(reference) q, negated if
/// its w is negative. The components x, y and z of d are encoded: a component low + k * step is
/// stored as the integer k in `bits` bits. A component with 0 bits always has the value `low`. The
/// decoder computes w from the other components. A joint that may rotate in any direction uses
/// smallest-three encoding of q instead, with `smallest_three_bits` per component.
struct RotationQuantization {
  static constexpr std::uint8_t kMaxBits = 16;
  static constexpr std::uint8_t kMinFreeBits = 8;
  static constexpr std::uint8_t kMaxFreeBits = 15;
  static constexpr float kMinStep = 0x1p-20f;
  /// Minimum of least_w. The decoder computes w from the other components, so the error of a
  /// smaller w would be too large.
  static constexpr float kMinLeastW = 0.3f;

  Quat reference = kIdentityQuat;
  Vec3 low = Vec3(0.0f);  ///< Minimum of each component, in [-1, 1].
  /// Difference between successive values of each component, kMinStep to 2. Unused for components
  /// with 0 bits.
  Vec3 step = Vec3(1.0f);
  std::array<std::uint8_t, 3> bits{};  ///< Bits of each component, 0 to kMaxBits.
  /// Bits per component of smallest-three encoding, kMinFreeBits to kMaxFreeBits; 0: not used.
  std::uint8_t smallest_three_bits = 0;
  float least_w = 1.0f;  ///< Minimum of the w of d, kMinLeastW to 1.
  bool operator==(const RotationQuantization&) const = default;
};

}  // namespace stridewire
