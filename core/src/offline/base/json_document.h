#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string_view>

#include "stridewire/base/error.h"

namespace stridewire {

/// Parses untrusted JSON without exceptions. Limits the nesting and rejects duplicate keys. The
/// caller must limit the size of `text`, because the document uses up to about 50 times as much
/// memory.
///
/// Errors: kMalformed for invalid JSON or a duplicate key, kOutOfRange for a number too large for a
/// double, and kLimitExceeded if values are nested too deeply. Error::where is "name:line:column".
/// Lines and columns count from 1, and columns are in bytes.
[[nodiscard]] Expected<nlohmann::json> ParseJson(std::string_view text, std::string_view name,
                                                 int max_depth);

}  // namespace stridewire
