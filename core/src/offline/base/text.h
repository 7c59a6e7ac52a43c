#pragma once

#include <cstdio>
#include <string>

namespace stridewire {

// A number within a sentence; `format` is printf's, and the whole shorter than 128 bytes.
[[nodiscard]] inline std::string Text(const char* format, double value) {
  char text[128];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

}  // namespace stridewire
