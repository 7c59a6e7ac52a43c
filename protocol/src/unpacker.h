#pragma once

#include <flatbuffers/flatbuffers.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "findings.h"

namespace stridewire::protocol {

/// Copies a message from verified bytes. Checks lengths before copying, because many FlatBuffers
/// offsets can refer to the same bytes, so that a decoded message could be much larger than its
/// payload.
class Unpacker : public Findings {
 public:
  /// Returns the number of entries to read; 0 if there is no list. If the list is too long or not
  /// aligned, reports an error and returns 0.
  template <typename T>
  std::size_t CountOf(const flatbuffers::Vector<T>* list, const Bounds& bounds,
                      const FieldPath& at) {
    if (list == nullptr) return 0;
    // The verifier checks only the alignment of the length field, which is 4 bytes.
    if (reinterpret_cast<std::uintptr_t>(list->Data()) % alignof(std::remove_pointer_t<T>) != 0) {
      Wrong(ErrorCode::kMalformed, "the list is not aligned", at);
      return 0;
    }
    if (list->size() <= bounds.max) return list->size();
    Wrong(ErrorCode::kLimitExceeded, bounds.expected, at, list->size());
    return 0;
  }

  void CopyText(const flatbuffers::String* text, const Bounds& bounds, const FieldPath& at,
                std::string& out) {
    if (text == nullptr) return;
    if (text->size() > bounds.max) {
      Wrong(ErrorCode::kLimitExceeded, bounds.expected, at, text->size());
      return;
    }
    out.assign(text->data(), text->size());
  }

  /// Refers to a list of numbers. `T` is a number, an enum or std::byte of the same size.
  template <typename W, typename T>
  void Borrow(const flatbuffers::Vector<W>* list, const Bounds& bounds, const FieldPath& at,
              std::span<const T>& out) {
    static_assert(sizeof(W) == sizeof(T));
    if (const std::size_t count = CountOf(list, bounds, at); count > 0) {
      out = {reinterpret_cast<const T*>(list->data()), count};
    }
  }
  /// Copies such a list.
  template <typename W, typename T>
  void Entries(const flatbuffers::Vector<W>* list, const Bounds& bounds, const FieldPath& at,
               std::vector<T>& out) {
    std::span<const T> entries;
    Borrow(list, bounds, at, entries);
    out.assign(entries.begin(), entries.end());
  }
};

}  // namespace stridewire::protocol
