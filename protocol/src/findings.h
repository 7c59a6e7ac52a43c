#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "utf8.h"

namespace stridewire::protocol {

/// Position of a field: a chain of names that begins with the message. It is converted to text only
/// if an error is reported, so that successful checks allocate nothing.
struct FieldPath {
  const FieldPath* parent = nullptr;
  std::string_view name;
  std::int64_t index = -1;  ///< Index of an entry, if the field is a list.
};

[[nodiscard]] inline FieldPath At(const FieldPath& parent, std::string_view name) {
  return {&parent, name, -1};
}
/// Returns the path of an entry of the list at `list`.
[[nodiscard]] inline FieldPath Entry(const FieldPath& list, std::size_t index) {
  return {list.parent, list.name, static_cast<std::int64_t>(index)};
}

/// Bounds of the length of a list or text, and the text of the error if they are exceeded.
struct Bounds {
  std::size_t min = 0;
  std::size_t max = 0;
  const char* expected = "";
};

/// Checks values and stores the first error. `Error::where` is the path without indices, for
/// example "Spawn.items.heading_rad". `Error::index` is the index of the outermost list in the
/// path, otherwise the offending value if it is an integer.
class Findings {
 public:
  [[gnu::cold]] void Wrong(ErrorCode code, const char* text, const FieldPath& at,
                           std::int64_t value = -1);

  [[nodiscard]] bool ok() const { return !error_; }

  /// Checks a value or a rule between fields.
  template <std::integral Value>
  void That(bool holds, const FieldPath& at, Value value, const char* expected,
            ErrorCode code = ErrorCode::kOutOfRange) {
    if (!holds) Wrong(code, expected, at, static_cast<std::int64_t>(value));
  }
  void That(bool holds, ErrorCode code, const char* text, const FieldPath& at) {
    if (!holds) Wrong(code, text, at);
  }

  void Count(std::size_t count, const Bounds& bounds, const FieldPath& at) {
    const auto value = static_cast<std::int64_t>(count);
    if (count < bounds.min) Wrong(ErrorCode::kMalformed, bounds.expected, at, value);
    if (count > bounds.max) Wrong(ErrorCode::kLimitExceeded, bounds.expected, at, value);
  }

  void Text(std::string_view text, const Bounds& bounds, const FieldPath& at) {
    Count(text.size(), bounds, at);
    if (text.size() > bounds.max || IsCleanUtf8(text)) return;
    Wrong(ErrorCode::kMalformed, "expected UTF-8 without control characters", at);
  }

  /// Checks every entry of a list of numbers.
  void Entries(const auto& list, auto holds, ErrorCode code, const char* text,
               const FieldPath& at) {
    const auto wrong = std::ranges::find_if_not(list, holds);
    if (wrong == list.end()) return;
    Wrong(code, text, Entry(at, static_cast<std::size_t>(wrong - list.begin())));
  }

  [[nodiscard]] Status Result() {
    if (error_) return std::unexpected(std::move(*error_));
    return {};
  }

 private:
  std::optional<Error> error_;
};

}  // namespace stridewire::protocol
