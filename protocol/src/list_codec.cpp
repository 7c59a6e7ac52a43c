#include "codec_support.h"

/// Encodes, decodes and checks sets of parameters, which are lists on the wire.
namespace stridewire::protocol {

void CheckList(Findings& found, const ParameterSet& set, const Bounds& bounds,
               const FieldPath& at) {
  found.Count(set.count, bounds, at);
  unsigned seen = 0;
  for (std::size_t p = 0; p < set.count && found.ok(); ++p) {
    found.Known(set.names[p], kParameterNames - 1, at, "expected a parameter name from 0 to 8");
    if (!found.ok()) return;
    const unsigned bit = 1u << set.names[p];
    found.That((seen & bit) == 0, ErrorCode::kMalformed, "a parameter occurs twice", at);
    seen |= bit;
    found.Finite(set.values[p], at);
  }
}

void UnpackList(Unpacker& u, const WireParameters* list, const Bounds& bounds, const FieldPath& at,
                ParameterSet& out) {
  out.count = static_cast<std::uint8_t>(u.CountOf(list, bounds, at));
  for (std::size_t p = 0; p < out.count; ++p) {
    const auto* value = list->Get(static_cast<flatbuffers::uoffset_t>(p));
    out.names[p] = value->name();
    out.values[p] = value->value();
  }
}

Offset<WireParameters> StructList(FlatBufferBuilder& b, const ParameterSet& set, bool) {
  if (set.count == 0) return {};
  std::array<wire::ParameterValue, kMaxParameters> values;
  for (std::size_t p = 0; p < set.count; ++p) {
    values[p] = wire::ParameterValue(set.values[p], set.names[p]);
  }
  return b.CreateVectorOfStructs(values.data(), set.count);
}

}  // namespace stridewire::protocol
