#pragma once

#include <cstddef>
#include <cstdint>

#include "stridewire/protocol/compact_codec.h"

namespace stridewire::protocol {

/// A block of CompactCodec::kBlock poses: arrays as in CompactCodec::Block.
struct CompactWork {
  std::size_t count;       // The first poses; others mean nothing.
  const float* roots_m;    // [x y z][pose]
  const float* rotations;  // [joint][x y z w][pose]
  float* errors;           // [joint][x y z][pose]
  std::uint32_t* words;    // [word / 4][pose][word % 4]
  std::uint32_t* fits;     // [pose]: not 0
};

/// Vectors of any width (Google Highway) give the same bytes.
void EncodeCompact(const CompactJoint* joints, std::size_t joint_count, const CompactWork& work);

}  // namespace stridewire::protocol
