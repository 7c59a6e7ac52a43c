#pragma once

#include <nlohmann/json.hpp>

#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Converts a message to the JSON of the test vectors, with the field names of the schema. 64-bit
/// integers are decimal strings, because JavaScript numbers are exact only up to 2^53. Tokens are
/// hexadecimal, enumerators are numbers, and poses are decoded.
[[nodiscard]] nlohmann::ordered_json ToJson(const Message& message);

/// Converts the JSON of ToJson back to a message. A PoseBatch borrows arrays that are never freed.
/// Throws std::invalid_argument for an unknown type, and the exceptions of nlohmann::json if
/// members have other types.
[[nodiscard]] Message FromJson(const nlohmann::ordered_json& json);

}  // namespace stridewire::protocol
