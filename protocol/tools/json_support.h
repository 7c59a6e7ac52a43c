#pragma once

#include <optional>

#include "test_vectors.h"

/// Functions that the generated code (fields_json.cpp) calls.
namespace stridewire::protocol {

using Json = nlohmann::ordered_json;

[[nodiscard]] std::string Hexadecimal(const std::vector<std::byte>& bytes);

/// Decodes the poses of a batch.
[[nodiscard]] Json PosesOf(const PoseBatch& m);
/// Encodes the poses of `json` into `m`. The mode and the number of joints of `m` must be set.
void ReadPoses(const Json& json, PoseBatch& m);

// Get reads a member of a JSON object. If the member is absent, `out` does not change. If it has
// another type, Get throws an exception of nlohmann::json.

template <typename T>
void Get(const Json& json, const char* name, T& out) {
  if (const auto member = json.find(name); member != json.end()) member->get_to(out);
}
template <typename T>
void Get(const Json& json, const char* name, std::optional<T>& out) {
  const auto member = json.find(name);
  if (member != json.end() && !member->is_null()) member->get_to(out.emplace());
}
/// 64-bit integers are decimal strings, because many languages read JSON numbers as doubles, which
/// represent integers exactly only up to 2^53.
void Get(const Json& json, const char* name, std::uint64_t& out);
void Get(const Json& json, const char* name, std::vector<std::byte>& out);

}  // namespace stridewire::protocol

#include "fields_json.h"
