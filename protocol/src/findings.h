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

  /// Checks an integer or a rule between fields.
  template <std::integral Value>
  void That(bool holds, const FieldPath& at, Value value, const char* expected,
            ErrorCode code = ErrorCode::kOutOfRange) {
    if (!holds) Wrong(code, expected, at, static_cast<std::int64_t>(value));
  }
  void That(bool holds, ErrorCode code, const char* text, const FieldPath& at) {
    if (!holds) Wrong(code, text, at);
  }

  void NonZero(std::uint64_t value, const FieldPath& at) {
    if (value == 0) Wrong(ErrorCode::kOutOfRange, "expected a number other than 0", at);
  }

  void AreFinite(const FieldPath& at, std::floating_point auto... values) {
    if (!(std::isfinite(values) && ...)) {
      Wrong(ErrorCode::kOutOfRange, "expected a finite number", at);
    }
  }
  void Finite(double value, const FieldPath& at) { AreFinite(at, value); }
  void Above(double value, double bound, const FieldPath& at, const char* expected) {
    if (!(std::isfinite(value) && value > bound)) Wrong(ErrorCode::kOutOfRange, expected, at);
  }
  void AtLeast(double value, double bound, const FieldPath& at, const char* expected) {
    if (!(std::isfinite(value) && value >= bound)) Wrong(ErrorCode::kOutOfRange, expected, at);
  }

  template <typename E>
  void Known(E value, unsigned last, const FieldPath& at, const char* expected) {
    if (static_cast<unsigned>(value) > last) {
      Wrong(ErrorCode::kMalformed, expected, at, static_cast<std::int64_t>(value));
    }
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

  void NonZeroEntries(const auto& list, const FieldPath& at) {
    const auto zero = std::ranges::find(list, 0u);
    if (zero != list.end()) NonZero(0, Entry(at, static_cast<std::size_t>(zero - list.begin())));
  }
  void FiniteEntries(const auto& list, const FieldPath& at) {
    std::size_t i = 0;
    for (const auto entry : list) Finite(entry, Entry(at, i++));
  }
  void KnownEntries(const auto& list, unsigned last, const FieldPath& at, const char* expected) {
    std::size_t i = 0;
    for (const auto entry : list) Known(entry, last, Entry(at, i++), expected);
  }

  [[nodiscard]] Status Result() {
    if (error_) return std::unexpected(std::move(*error_));
    return {};
  }

 private:
  std::optional<Error> error_;
};

}  // namespace stridewire::protocol
