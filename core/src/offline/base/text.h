#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>

namespace stridewire {

// Formats a string like printf. The result is truncated to 511 bytes.
[[nodiscard]] __attribute__((format(printf, 1, 2))) inline std::string Text(const char* format,
                                                                            ...) {
  char text[512];
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

}  // namespace stridewire
