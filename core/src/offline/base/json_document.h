#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string_view>

#include "stridewire/base/error.h"

namespace stridewire {

/// Parses JSON from outside without exceptions: nesting is limited, a key may stand only once in its
/// object, and an error tells line and column. `text` is at most as long as the caller allows; the
/// document takes at most about 50 times that.
/// kMalformed, kOutOfRange (a number beyond double), kLimitExceeded (nesting); `where` is
/// "name:line:column", both from 1, columns in bytes.
[[nodiscard]] Expected<nlohmann::json> ParseJson(std::string_view text, std::string_view name,
                                                 int max_depth);

}  // namespace stridewire
