#pragma once

#include <vector>

#include "codec.h"

/// Functions that the generated code (codec.cpp) calls for lists.
namespace stridewire::protocol {

template <typename T>
void CheckList(Findings& found, const std::vector<T>& list, const Bounds& bounds,
               const FieldPath& at) {
  found.Count(list.size(), bounds, at);
  for (std::size_t i = 0; i < list.size(); ++i) {
    CheckFields(found, {at.parent, at.name, i}, list[i]);
  }
}

template <typename W, typename T>
void UnpackList(Findings& found, const flatbuffers::Vector<W>* list, const Bounds& bounds,
                const FieldPath& at, std::vector<T>& out) {
  out.resize(found.CountOf(list, bounds, at));
  for (std::size_t i = 0; i < out.size(); ++i) {
    Unpack(found, {at.parent, at.name, i}, *list->Get(static_cast<flatbuffers::uoffset_t>(i)),
           out[i]);
  }
}

}  // namespace stridewire::protocol
