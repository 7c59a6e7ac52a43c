#pragma once

#include <cstdio>
#include <string>

namespace stridewire {

// Formats a number as part of a sentence. `format` is a printf format for one double; the result is
// truncated to 127 bytes.
[[nodiscard]] inline std::string Text(const char* format, double value) {
  char text[128];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

}  // namespace stridewire
