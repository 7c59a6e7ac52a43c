#pragma once

#include <flatbuffers/flatbuffers.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "findings.h"
#include "stridewire/protocol/messages.h"
#include "stridewire_generated.h"
#include "unpacker.h"

namespace stridewire::protocol {

using flatbuffers::FlatBufferBuilder;
using flatbuffers::Offset;

}  // namespace stridewire::protocol

#include "codec.h"

/// Functions that the generated code (codec.cpp) calls, mostly for lists. The schema's attributes
/// name the cases; protocol/generator/README.md explains them.
namespace stridewire::protocol {

void CheckList(Findings& found, const std::vector<ParameterValue>& list, const Bounds& bounds,
               const FieldPath& at);
template <typename T>
void CheckList(Findings& found, const std::vector<T>& list, const Bounds& bounds,
               const FieldPath& at) {
  found.Count(list.size(), bounds, at);
  for (std::size_t i = 0; i < list.size(); ++i) CheckFields(found, Entry(at, i), list[i]);
}

template <typename W, typename T>
void UnpackList(Unpacker& u, const flatbuffers::Vector<W>* list, const Bounds& bounds,
                const FieldPath& at, std::vector<T>& out) {
  out.resize(u.CountOf(list, bounds, at));
  for (std::size_t i = 0; i < out.size(); ++i) {
    Unpack(u, Entry(at, i), *list->Get(static_cast<flatbuffers::uoffset_t>(i)), out[i]);
  }
}

// Empty lists are omitted, unless `keep_empty` is true.

/// Builds a list of numbers, enums or bytes.
auto ScalarList(FlatBufferBuilder& b, const auto& list, bool keep_empty) {
  using T = std::remove_cvref_t<decltype(list[0])>;
  using Number = std::conditional_t<std::is_arithmetic_v<T>, T, std::uint8_t>;
  static_assert(sizeof(Number) == sizeof(T));
  if (list.empty() && !keep_empty) return Offset<flatbuffers::Vector<Number>>();
  return b.CreateVector(reinterpret_cast<const Number*>(list.data()), list.size());
}

template <typename T>
auto StructList(FlatBufferBuilder& b, const std::vector<T>& list, bool keep_empty) {
  using Wire = decltype(ToWire(std::declval<const T&>()));
  if (list.empty() && !keep_empty) return Offset<flatbuffers::Vector<const Wire*>>();
  std::vector<Wire> structs;
  structs.reserve(list.size());
  for (const T& entry : list) structs.push_back(ToWire(entry));
  return b.CreateVectorOfStructs(structs);
}

/// Builds the tables of a list, which TableList combines.
template <typename T>
auto Entries(FlatBufferBuilder& b, const std::vector<T>& list) {
  std::vector<decltype(Build(b, list[0]))> entries;
  entries.reserve(list.size());
  for (const T& entry : list) entries.push_back(Build(b, entry));
  return entries;
}
template <typename T>
auto TableList(FlatBufferBuilder& b, const std::vector<Offset<T>>& entries, bool keep_empty) {
  if (entries.empty() && !keep_empty) return Offset<flatbuffers::Vector<Offset<T>>>();
  return b.CreateVector(entries);
}

}  // namespace stridewire::protocol
