#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

using Json = nlohmann::ordered_json;

/// Converts a 64-bit integer, which JSON numbers cannot represent in every language.
[[nodiscard]] inline std::string Decimal(std::uint64_t value) { return std::to_string(value); }

template <typename E>
[[nodiscard]] int Number(E e) {
  return static_cast<int>(e);
}

[[nodiscard]] std::string Hex(const std::vector<std::byte>& bytes);
[[nodiscard]] Json ListJson(const ParameterSet& set);

template <typename V>
  requires std::is_same_v<V, Vec3> || std::is_same_v<V, DVec3>
[[nodiscard]] Json Fields(const V& v) {
  return Json::array({v.x, v.y, v.z});
}

}  // namespace stridewire::protocol

#include "fields_json.h"

namespace stridewire::protocol {

template <typename T>
[[nodiscard]] Json ListJson(const std::vector<T>& list) {
  Json json = Json::array();
  for (const T& entry : list) json.push_back(Fields(entry));
  return json;
}

template <typename E>
[[nodiscard]] Json NumbersJson(const std::vector<E>& list) {
  Json json = Json::array();
  for (const E entry : list) json.push_back(Number(entry));
  return json;
}

}  // namespace stridewire::protocol
