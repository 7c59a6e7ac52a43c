#pragma once

#include <cstdint>

namespace stridewire {

/// Returns a hash of a number. Even neighbouring numbers have unrelated hashes (SplitMix64; Steele,
/// Lea and Flood 2014).
[[nodiscard]] constexpr std::uint64_t Scramble(std::uint64_t number) {
  std::uint64_t bits = number + 0x9e3779b97f4a7c15u;
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9u;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
  return bits ^ (bits >> 31);
}

/// Maps random bits to a number in [0, 1).
[[nodiscard]] constexpr double FractionOf(std::uint64_t bits) {
  constexpr double kPerUnit = 1.0 / 9007199254740992.0;  // 2^-53
  return static_cast<double>(bits >> 11) * kPerUnit;
}

}  // namespace stridewire
