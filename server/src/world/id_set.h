#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "world/world.h"

namespace stridewire::server {

/// Union of many lists of avatar ids. Optimized for small, dense ids.
class IdSet {
 public:
  void Add(std::span<const AvatarId> ids) {
    for (const AvatarId id : ids) {
      if (id >= kSmallIds) {
        large_.push_back(id);
        continue;
      }
      const std::size_t word = id / 64;
      if (word >= bits_.size()) bits_.resize(word + 1);
      bits_[word] |= std::uint64_t{1} << id % 64;
    }
  }

  /// Returns all ids in ascending order and clears the set.
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
  // Ids below this are stored as bits, which take at most 128 KiB.
  static constexpr AvatarId kSmallIds = 1u << 20;
  std::vector<std::uint64_t> bits_;
  std::vector<AvatarId> large_;
};

}  // namespace stridewire::server
