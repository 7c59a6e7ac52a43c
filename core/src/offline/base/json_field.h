#pragma once

#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>

#include "stridewire/base/error.h"

/// Reading values out of a JSON document, with errors that name the way to them.
namespace stridewire {

/// A value of the document and the way to it, for errors: "c.json: movements[3].step".
struct JsonField {
  const nlohmann::json& value;
  std::string where;

  /// Null where there is no such key.
  [[nodiscard]] const nlohmann::json* Find(const char* key) const {
    const auto found = value.find(key);
    return found == value.end() ? nullptr : &*found;
  }
  [[nodiscard]] std::string WhereOf(const std::string& key) const {
    return where + (where.ends_with(": ") ? "" : ".") + key;
  }
};

/// A number's limit and the sentence that tells it.
struct JsonLimit {
  double min;
  double max;
  const char* text;
};

/// The field is an object and has no other keys than these.
[[nodiscard]] Status CheckKeys(const JsonField& field, std::initializer_list<const char*> known);

/// kMalformed: not a number; kOutOfRange. On an error `out` stays as it was.
[[nodiscard]] Status ReadNumberAt(const nlohmann::json& value, std::string where,
                                  const JsonLimit& limit, double& out);

/// Leaves `out` alone when the key is not there.
[[nodiscard]] Status ReadNumber(const JsonField& field, const char* key, const JsonLimit& limit,
                                double& out);

[[nodiscard]] Status ReadRequiredNumber(const JsonField& field, const char* key,
                                        const JsonLimit& limit, double& out);

/// The text of a file, up to one byte more than `max_bytes`, which tells that there is more.
/// kNotFound, kIo with `where` = file.
[[nodiscard]] Expected<std::string> ReadTextFile(const std::filesystem::path& path,
                                                 std::size_t max_bytes);

}  // namespace stridewire
