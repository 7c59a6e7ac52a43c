#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

using Json = nlohmann::ordered_json;

// Value converts a member of a message, and Fields a struct. 64-bit integers become decimal
// strings, because JSON numbers cannot represent them in every language. Enumerators become
// numbers, and opaque bytes hexadecimal digits.

[[nodiscard]] inline Json Value(std::uint64_t value) { return std::to_string(value); }
[[nodiscard]] Json Value(const std::vector<std::byte>& bytes);
[[nodiscard]] inline Json Value(const std::string& text) { return text; }
template <typename T>
  requires std::is_arithmetic_v<T>
[[nodiscard]] Json Value(T value) {
  return value;
}
template <typename E>
  requires std::is_enum_v<E>
[[nodiscard]] Json Value(E value) {
  return static_cast<int>(value);
}

// FromJson is the reverse of Fields. It throws the exceptions of nlohmann::json for JSON of another
// shape.

template <typename T>
  requires std::is_arithmetic_v<T>
void FromJson(const Json& json, T& out) {
  if (json.is_string()) {
    out = static_cast<T>(std::stoull(json.get<std::string>()));
  } else {
    json.get_to(out);
  }
}
template <typename E>
  requires std::is_enum_v<E>
void FromJson(const Json& json, E& out) {
  out = static_cast<E>(json.get<std::underlying_type_t<E>>());
}
inline void FromJson(const Json& json, std::string& out) { json.get_to(out); }
void FromJson(const Json& json, std::vector<std::byte>& out);

/// Decodes the poses of a batch.
[[nodiscard]] Json PosesOf(const PoseBatch& m);
/// Encodes them. The mode and the number of joints must be set.
void ReadPoses(const Json& json, PoseBatch& m);

}  // namespace stridewire::protocol

#include "fields_json.h"

namespace stridewire::protocol {

template <typename T>
  requires requires(const T& message) { Fields(message); }
[[nodiscard]] Json Value(const T& message) {
  return Fields(message);
}
template <typename T>
[[nodiscard]] Json Value(const std::vector<T>& list) {
  Json json = Json::array();
  for (const T& entry : list) json.push_back(Value(entry));
  return json;
}
template <typename T>
[[nodiscard]] Json Value(const std::optional<T>& value) {
  return value ? Value(*value) : Json(nullptr);
}

template <typename T>
void FromJson(const Json& json, std::vector<T>& out) {
  out.resize(json.size());
  for (std::size_t i = 0; i < out.size(); ++i) FromJson(json.at(i), out[i]);
}
template <typename T>
void FromJson(const Json& json, std::optional<T>& out) {
  out.reset();
  if (!json.is_null()) FromJson(json, out.emplace());
}

/// Reads a member of an object. If the member is absent, `out` does not change.
template <typename T>
void Get(const Json& json, const char* name, T& out) {
  if (const auto member = json.find(name); member != json.end()) FromJson(*member, out);
}

}  // namespace stridewire::protocol
