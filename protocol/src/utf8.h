#pragma once

#include <string_view>

namespace stridewire::protocol {

/// Returns whether text is well-formed UTF-8 (Unicode 15, Table 3-7: no surrogates, no overlong
/// forms) without control characters. Newline and tab are rejected as well, because texts appear in
/// logs.
[[nodiscard]] bool IsCleanUtf8(std::string_view text);

}  // namespace stridewire::protocol
