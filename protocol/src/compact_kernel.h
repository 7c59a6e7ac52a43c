#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stridewire/protocol/compact_codec.h"

namespace stridewire::protocol {

/// The numbers of a pose are stored in rows: three for the root, one row of zeros, and kJointRows
/// per joint.
inline constexpr std::uint16_t kZeroRow = 3;
inline constexpr std::size_t kJointRows = 4;

/// The constant inputs of the encoder.
struct CompactPlan {
  std::span<const CompactJoint> joints;
  std::span<const std::uint16_t> order;  // Indices of all joints, each after its parent.
  std::span<const CompactPart> parts;    // Parts of all words, whose number is a multiple of 4.
};

/// A block of CompactCodec::kBlock poses. The arrays are those of CompactCodec::Block.
struct CompactWork {
  std::size_t count;       // Number of valid poses.
  bool are_unit;           // Value of CompactCodec::SoaPoses::are_unit.
  const float* roots_m;    // [x y z][pose]
  const float* rotations;  // [joint][x y z w][pose]
  float* errors;           // [joint][x y z][pose]
  std::uint32_t* numbers;  // [CompactPart::row][pose]
  std::uint32_t* words;    // [word / 4][pose][word % 4]
  std::uint32_t* fits;     // [pose]: 1 if all rotations are in range, otherwise 0.
};

/// Encodes a block. The bytes do not depend on the vector width of the machine.
void EncodeCompact(const CompactPlan& plan, const CompactWork& work);

/// Copies `fours` groups of four words of one pose with non-temporal stores. `to` is aligned to 16
/// bytes.
void StreamWords(const std::uint32_t* words, std::size_t fours, std::byte* to);

}  // namespace stridewire::protocol
