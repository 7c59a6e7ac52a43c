#pragma once

#include <optional>

#include "test_vectors.h"

/// Functions that the generated code (fields_json.cpp) calls.
namespace stridewire::protocol {

using Json = nlohmann::ordered_json;

[[nodiscard]] std::string Hexadecimal(const std::vector<std::byte>& bytes);

/// Decodes the poses of a batch.
[[nodiscard]] Json PosesOf(const PoseBatch& m);
/// Encodes them. The mode and the number of joints must be set.
void ReadPoses(const Json& json, PoseBatch& m);

// Get reads a member of an object. If the member is absent, `out` does not change. The functions
// throw the exceptions of nlohmann::json for JSON of another shape.

template <typename T>
void Get(const Json& json, const char* name, T& out) {
  if (const auto member = json.find(name); member != json.end()) member->get_to(out);
}
template <typename T>
void Get(const Json& json, const char* name, std::optional<T>& out) {
  const auto member = json.find(name);
  if (member != json.end() && !member->is_null()) member->get_to(out.emplace());
}
/// 64-bit integers are decimal strings, because JSON numbers cannot represent them in every
/// language.
void Get(const Json& json, const char* name, std::uint64_t& out);
void Get(const Json& json, const char* name, std::vector<std::byte>& out);

}  // namespace stridewire::protocol

#include "fields_json.h"
