#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "world/world.h"

namespace stridewire::server {

/// Collects avatar numbers of many lists, each once. Most are small and lie close together.
class IdSet {
 public:
  void Add(std::span<const AvatarId> numbers) {
    for (const AvatarId number : numbers) {
      if (number >= kSmall) {
        large_.push_back(number);
        continue;
      }
      const std::size_t word = number / 64;
      if (word >= bits_.size()) bits_.resize(word + 1);
      bits_[word] |= std::uint64_t{1} << number % 64;
    }
  }

  /// All of them, growing; then there are none.
  [[nodiscard]] std::vector<AvatarId> Take() {
    std::vector<AvatarId> all;
    for (std::size_t word = 0; word < bits_.size(); ++word) {
      for (std::uint64_t bits = bits_[word]; bits != 0; bits &= bits - 1) {
        all.push_back(static_cast<AvatarId>(64 * word) +
                      static_cast<AvatarId>(std::countr_zero(bits)));
      }
    }
    std::ranges::sort(large_);
    std::ranges::unique_copy(large_, std::back_inserter(all));
    bits_.clear();
    large_.clear();
    return all;
  }

 private:
  static constexpr AvatarId kSmall = 1u << 20;  // 128 KB of bits
  std::vector<std::uint64_t> bits_;
  std::vector<AvatarId> large_;
};

}  // namespace stridewire::server
