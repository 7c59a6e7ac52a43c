#pragma once

#include <flatbuffers/flatbuffers.h>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>

#include "stridewire/base/error.h"
#include "utf8.h"

namespace stridewire::protocol {

/// Position of a field: a chain of names that begins with the message. It is converted to text only
/// if an error is reported, so that successful checks allocate nothing.
struct FieldPath {
  static constexpr std::size_t kNoIndex = -1;
  const FieldPath* parent = nullptr;
  std::string_view name;
  std::size_t index = kNoIndex;  ///< Index of an entry, if the field is a list.
};

/// Bounds of the length of a list or text, and the text of the error if they are exceeded.
struct Bounds {
  std::size_t min = 0;
  std::size_t max = 0;
  const char* expected = "";
};

/// Copies lists and checks values, and stores the first error. `Error::where` is the path without
/// indices, for example "Spawn.items.heading_rad". `Error::index` is the index in the outermost
/// list of the path. If the path contains no list, it is the offending value if that is an integer.
class Findings {
 public:
  [[gnu::cold]] void Wrong(ErrorCode code, const char* text, const FieldPath& at,
                           std::int64_t value = -1);

  [[nodiscard]] bool ok() const { return !error_; }

  /// Stores an error unless `holds`, the result of a check of a value or of a rule between fields.
  template <std::integral Value = int>
  void That(bool holds, const FieldPath& at, const char* text,
            ErrorCode code = ErrorCode::kOutOfRange, Value value = -1) {
    if (!holds) Wrong(code, text, at, static_cast<std::int64_t>(value));
  }

  void That(const Status& holds, const FieldPath& at) {
    if (!holds) Wrong(holds.error().code, holds.error().text, at, holds.error().index);
  }

  void Count(std::size_t count, const Bounds& bounds, const FieldPath& at) {
    That(count >= bounds.min, at, bounds.expected, ErrorCode::kMalformed, count);
    That(count <= bounds.max, at, bounds.expected, ErrorCode::kLimitExceeded, count);
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
    Wrong(code, text, {at.parent, at.name, static_cast<std::size_t>(wrong - list.begin())});
  }

  /// Checks that the numbers `key(entry)` of a list are below `count` and differ from each other.
  /// `count` is at most 32.
  void Keys(const auto& list, auto key, unsigned count, const char* expected, const char* twice,
            const FieldPath& at) {
    std::uint32_t seen = 0;
    for (const auto& entry : list) {
      const unsigned number = std::invoke(key, entry);
      That(number < count, at, expected, ErrorCode::kMalformed, number);
      const std::uint32_t bit = 1u << (number % 32);
      That((seen & bit) == 0, at, twice, ErrorCode::kMalformed, number);
      seen |= bit;
    }
  }

  /// Returns the number of entries to copy from a list of a message; 0 if there is no list. If the
  /// list is too long or not aligned, reports an error and returns 0. Lengths must be checked
  /// before copying, because many FlatBuffers offsets can refer to the same bytes, so that a
  /// decoded message could be much larger than its payload.
  template <typename T>
  std::size_t CountOf(const flatbuffers::Vector<T>* list, const Bounds& bounds,
                      const FieldPath& at) {
    if (list == nullptr) return 0;
    // The verifier checks only the alignment of the length field, which is 4 bytes.
    const auto address = reinterpret_cast<std::uintptr_t>(list->Data());
    const bool is_aligned = address % alignof(std::remove_pointer_t<T>) == 0;
    That(is_aligned, at, "the list is not aligned", ErrorCode::kMalformed);
    const std::size_t count = list->size();
    That(count <= bounds.max, at, bounds.expected, ErrorCode::kLimitExceeded, count);
    return is_aligned && count <= bounds.max ? count : 0;
  }

  /// Copies a text or a list of numbers, enums or bytes. If `out` is a span, it refers to the list.
  template <typename W, typename List>
  void Copy(const flatbuffers::Vector<W>* list, const Bounds& bounds, const FieldPath& at,
            List& out) {
    using T = typename List::value_type;
    static_assert(sizeof(W) == sizeof(T));
    if (const std::size_t count = CountOf(list, bounds, at); count > 0) {
      const auto* entries = reinterpret_cast<const T*>(list->data());
      out = List(entries, entries + count);
    }
  }

  [[nodiscard]] Status Result() {
    if (error_) return std::unexpected(std::move(*error_));
    return {};
  }

 private:
  std::optional<Error> error_;
};

}  // namespace stridewire::protocol
