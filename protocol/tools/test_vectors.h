#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/protocol/messages.h"

/// The messages of the test vectors, and the JSON in which protocol/vectors contains them.
namespace stridewire::protocol {

/// Converts a message to the JSON of the test vectors, with the field names of the schema. 64-bit
/// integers are decimal strings, because JavaScript numbers are exact only up to 2^53. Tokens are
/// hexadecimal, enumerators are numbers, and poses are decoded.
[[nodiscard]] nlohmann::ordered_json ToJson(const Message& message);

/// Converts the JSON of ToJson back to a message. A PoseBatch borrows arrays that are never freed.
/// Throws std::invalid_argument for an unknown type, and the exceptions of nlohmann::json if
/// members have other types.
[[nodiscard]] Message FromJson(const nlohmann::ordered_json& json);

/// Returns the messages of all test vectors, by their file names, for example "request_crowd". Most
/// fields differ from their defaults.
[[nodiscard]] std::map<std::string, Message> SampleMessages();

/// Returns the codecs for the compact poses of the vectors. Their parameters are those in the
/// vector `world_info_detail`.
[[nodiscard]] const CompactCodecs& SampleCodecs();

}  // namespace stridewire::protocol
