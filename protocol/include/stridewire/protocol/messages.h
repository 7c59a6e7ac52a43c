#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "stridewire/protocol/message_parts.h"
#include "stridewire/protocol/message_structs.h"

/// The messages of the protocol as plain structs. STANDARD.md defines their fields. The build
/// generates them from schema/stridewire.fbs (message_structs.h).
///
/// Encoder and decoder run the same checks (check.h): numbers are finite, ids are not 0, counts
/// match and are within limits.h, and texts are short UTF-8. The server alone checks whether an
/// avatar exists or a step is possible, and it replies item by item.
namespace stridewire::protocol {

/// Computes the size in bytes of each compressed pose of a compact batch, or 0 if all poses are
/// uncompressed. Returns an empty optional if the size of the batch does not match its flags.
[[nodiscard]] std::optional<std::size_t> CompactPoseBytes(const PoseBatch& batch);

/// Returns the record of the i-th avatar.
[[nodiscard]] inline std::span<const std::byte> RecordOf(const Movements& m, std::size_t i) {
  const std::size_t begin = i == 0 ? 0 : m.ends[i - 1];
  return std::span(m.records).subspan(begin, m.ends[i] - begin);
}

}  // namespace stridewire::protocol
