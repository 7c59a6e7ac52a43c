#pragma once

#include <string_view>

namespace stridewire::protocol {

/// Whether text is well-formed UTF-8 (Unicode 15, Table 3-7: no surrogates, no overlong forms) and
/// free of control characters, newline and tab included: it ends up in logs.
[[nodiscard]] bool IsCleanUtf8(std::string_view text);

}  // namespace stridewire::protocol
