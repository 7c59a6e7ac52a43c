#pragma once

#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>

#include "stridewire/base/error.h"

/// Helpers that read values from a JSON document. Their errors contain the path of the value.
namespace stridewire {

/// A value and its path in the document, for example "c.json: movements[3].step".
struct JsonField {
  const nlohmann::json& value;
  std::string where;

  /// Returns null if the key does not exist.
  [[nodiscard]] const nlohmann::json* Find(const char* key) const {
    const auto found = value.find(key);
    return found == value.end() ? nullptr : &*found;
  }
  [[nodiscard]] std::string WhereOf(const std::string& key) const {
    return where + (where.ends_with(": ") ? "" : ".") + key;
  }
};

/// The allowed range of a number, and an error message that states it.
struct JsonLimit {
  double min;
  double max;
  const char* text;
};

/// Checks that the field is an object whose keys are all in `known`. Otherwise, fails with
/// kMalformed.
[[nodiscard]] Status CheckKeys(const JsonField& field, std::initializer_list<const char*> known);

/// Reads a number. Errors: kMalformed if the value is not a number, kOutOfRange if it is outside
/// the limit. On error `out` remains unchanged.
[[nodiscard]] Status ReadNumberAt(const nlohmann::json& value, std::string where,
                                  const JsonLimit& limit, double& out);

/// Reads an optional number. If the key is absent, `out` remains unchanged.
[[nodiscard]] Status ReadNumber(const JsonField& field, const char* key, const JsonLimit& limit,
                                double& out);

/// Reads a required number. Fails with kMalformed if the key is absent.
[[nodiscard]] Status ReadRequiredNumber(const JsonField& field, const char* key,
                                        const JsonLimit& limit, double& out);

/// Reads at most `max_bytes` + 1 bytes of a file. If the result is longer than `max_bytes`, the
/// file exceeds the caller's limit. Errors: kNotFound or kIo, with the file in Error::where.
[[nodiscard]] Expected<std::string> ReadTextFile(const std::filesystem::path& path,
                                                 std::size_t max_bytes);

}  // namespace stridewire
