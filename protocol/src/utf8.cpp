#include "utf8.h"

#include <cstdint>

namespace stridewire::protocol {

bool IsCleanUtf8(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  for (std::size_t i = 0; i < text.size();) {
    const std::uint8_t first = byte(i);
    if (first < 0x80) {
      if (first < 0x20 || first == 0x7f) return false;
      ++i;
      continue;
    }
    const std::size_t length = first < 0xc2   ? 0
                               : first < 0xe0 ? 2
                               : first < 0xf0 ? 3
                               : first < 0xf5 ? 4
                                              : 0;
    if (length == 0 || i + length > text.size()) return false;
    for (std::size_t k = 1; k < length; ++k) {
      if ((byte(i + k) & 0xc0) != 0x80) return false;
    }
    const std::uint8_t second = byte(i + 1);
    if (first == 0xc2 && second < 0xa0) return false;  // C1 controls
    if (first == 0xe0 && second < 0xa0) return false;  // overlong
    if (first == 0xed && second > 0x9f) return false;  // surrogates
    if (first == 0xf0 && second < 0x90) return false;  // overlong
    if (first == 0xf4 && second > 0x8f) return false;  // past U+10FFFF
    i += length;
  }
  return true;
}

}  // namespace stridewire::protocol
