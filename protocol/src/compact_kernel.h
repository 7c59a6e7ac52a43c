#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stridewire/protocol/compact_codec.h"

namespace stridewire::protocol {

/// Rows of a pose's numbers: the root's three, a 0, then four of each joint.
inline constexpr std::uint16_t kZeroRow = 3;
inline constexpr std::size_t kJointRows = 4;

/// How poses are encoded.
struct CompactPlan {
  std::span<const CompactJoint> joints;
  std::span<const std::uint16_t> order;  // Of all joints: each behind its parent.
  std::span<const CompactPart> parts;    // Of words that come in fours.
};

/// A block of CompactCodec::kBlock poses: arrays as in CompactCodec::Block.
struct CompactWork {
  std::size_t count;       // The first poses; others mean nothing.
  bool are_unit;           // CompactCodec::Lanes::are_unit
  const float* roots_m;    // [x y z][pose]
  const float* rotations;  // [joint][x y z w][pose]
  float* errors;           // [joint][x y z][pose]
  std::uint32_t* numbers;  // [CompactPart::row][pose]
  std::uint32_t* words;    // [word / 4][pose][word % 4]
  std::uint32_t* fits;     // [pose]: not 0
};

/// Vectors of any width (Google Highway) give the same bytes.
void EncodeCompact(const CompactPlan& plan, const CompactWork& work);

/// Copies the words of one pose, four after four, past the caches. `to` is a multiple of 16.
void StreamWords(const std::uint32_t* words, std::size_t fours, std::byte* to);

}  // namespace stridewire::protocol
