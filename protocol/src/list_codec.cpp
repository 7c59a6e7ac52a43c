#include "codec_support.h"

/// Encodes, decodes and checks what the schema's attributes cannot express: sets of parameters and
/// lists of movement records.
namespace stridewire::protocol {

// ---- sets of parameters

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

// ---- movement records

Offset<wire::Movements> Build(FlatBufferBuilder& b, const Movements& m) {
  // Most steps of a small crowd have no changes, and then all lists are omitted. Otherwise the
  // records are written even if they are empty, because all avatars are gone.
  const auto records = ScalarList(b, m.records, !m.avatars.empty());
  const auto ends = ScalarList(b, m.ends, false);
  const auto flags = ScalarList(b, m.flags, false);
  const auto avatars = ScalarList(b, m.avatars, false);
  return wire::CreateMovements(b, m.world, m.shard, m.part, m.parts, m.more_steps, m.step, m.tick,
                               m.server_time_s, m.states, avatars, flags, ends, records);
}

}  // namespace stridewire::protocol
