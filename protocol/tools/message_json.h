#pragma once

#include <nlohmann/json.hpp>

#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// A message as JSON, field by field with the names of the schema: what the vectors' descriptions
/// hold. 64-bit integers are decimal strings (JavaScript numbers end at 2^53), tokens hexadecimal,
/// enumerators numbers, poses decoded.
[[nodiscard]] nlohmann::ordered_json ToJson(const Message& message);

}  // namespace stridewire::protocol
