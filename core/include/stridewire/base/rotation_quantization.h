#pragma once

#include <array>
#include <cstdint>

#include "stridewire/base/math.h"

namespace stridewire {

/// How the rotation q of one joint is told in few bits: by the components x, y, z of d = conj(reference) q, with the
/// sign that makes d's w positive. Component c is low + k step, k in `bits` bits (no bits: it is `low`); w follows.
/// A joint that turns every way has `smallest_three_bits` instead: the smallest three of q's components (pose_codec.h).
struct RotationQuantization {
  static constexpr std::uint8_t kMaxBits = 16;
  static constexpr std::uint8_t kMinFreeBits = 8;
  static constexpr std::uint8_t kMaxFreeBits = 15;
  static constexpr float kMinStep = 0x1p-20f;
  /// With a smaller w the last component would be badly told by the others.
  static constexpr float kMinLeastW = 0.3f;

  Quat reference = kIdentityQuat;
  Vec3 low = Vec3(0.0f);               ///< -1 to 1
  Vec3 step = Vec3(1.0f);              ///< kMinStep to 2; without bits all that is told as `low`
  std::array<std::uint8_t, 3> bits{};  ///< 0 to kMaxBits
  std::uint8_t smallest_three_bits = 0;          ///< 0, or kMinFreeBits to kMaxFreeBits of each of the three
  float least_w = 1.0f;                ///< d's w is not below it, kMinLeastW to 1
  bool operator==(const RotationQuantization&) const = default;
};

}  // namespace stridewire
