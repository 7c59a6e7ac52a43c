#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/base/rotation_quantization.h"

namespace stridewire::protocol {

/// Whether codes can be told and decoded: references unit, numbers finite, bits within RotationQuantization's limits, a root
/// that turns every way. kOutOfRange, kMalformed; `index` is the joint. None at all is allowed: a world without.
[[nodiscard]] Status CheckRotationCodes(std::span<const RotationQuantization> codes);

/// Whether some joints can be told without the others: numbers growing, the root among them and of each its parent.
/// kShapeMismatch: more than there are joints; kMalformed with `index` in `joints`.
[[nodiscard]] Status CheckFewerJoints(std::span<const std::uint16_t> joints,
                                      std::span<const std::int16_t> parents);

/// A RotationQuantization as the codec takes it.
struct CompactJoint {
  float reference[4] = {};  ///< x, y, z, w
  float low[3] = {};
  float step[3] = {};   ///< Of a free joint the first: of each of the three
  float steps[3] = {};  ///< 1 / step
  std::int32_t bits[3] = {};
  std::int32_t smallest_three_bits = 0;  ///< 0: not free
  float least_w = 0.0f;
  std::int32_t parent = -1;  ///< -1: none
  bool is_turned = false;    ///< `reference` is not 1
  bool bears_others = false;
  bool is_left_out = false;  ///< Decoded to `reference`, however it is turned.
};

/// What a 32-bit word of a pose has of one number.
struct CompactPart {
  std::uint16_t row = 0;  ///< Of the number, among those of a pose
  std::int8_t left = 0;   ///< Bits it is shifted by, to the right if negative
  bool ends_word = false;
};

/// PoseMode::kCompact (STANDARD.md, "Poses"): the root as in kQuantised, then every joint's bits behind one another, the
/// first of a number in the lowest bits, in little-endian words of 16 bits. What is left of the last word is 0.
///
/// Joints are encoded from the root on, each relative to what its parent is decoded to, so that it makes up for the errors
/// of those above: its own error is all that is left of its rotation in the world.
class CompactCodec {
 public:
  /// Poses that are encoded together.
  static constexpr std::size_t kBlock = 16;
  /// Of Block::StreamBytes.
  static constexpr std::size_t kPieceBytes = 16;
  static constexpr std::size_t kMostBehind = 3;

  /// `parents` has one entry a joint, -1 for the first, then below its own index. `told`: the joints that are told;
  /// none: all. Errors as CheckRotationCodes and CheckFewerJoints, kShapeMismatch: not as many parents; kOutOfRange:
  /// a parent.
  [[nodiscard]] static Expected<CompactCodec> Make(std::span<const RotationQuantization> codes,
                                                   std::span<const std::int16_t> parents,
                                                   std::span<const std::uint16_t> told = {});

  [[nodiscard]] std::size_t joint_count() const { return joints_.size(); }
  /// Bytes of a pose.
  [[nodiscard]] std::size_t pose_bytes() const { return pose_bytes_; }
  [[nodiscard]] std::size_t pieces() const { return (pose_bytes_ + kPieceBytes - 1) / kPieceBytes; }

  /// Poses side by side, of which the first `count` are there: all of joint_count() joints.
  struct Lanes {
    const float* roots_m;    ///< [x y z][kBlock]
    const float* rotations;  ///< [joint][x y z w][kBlock]
    std::size_t count;       ///< At most kBlock
    /// Rotations are unit, as who evaluates poses makes them, or no numbers at all: their lengths are not looked at.
    bool are_unit = false;
  };

  /// Up to kBlock poses on their way to be encoded, and what came of it. Keep one: only Encode of a codec with more
  /// joints than any before allocates.
  class Block {
   public:
    [[nodiscard]] std::size_t size() const { return size_; }
    /// Forgets them.
    void Clear() { size_ = 0; }
    /// Copies a pose in; there is room for kBlock.
    void Add(const Vec3& root_position_m, std::span<const Quat> rotations);
    /// The pose as it was added to it.
    void Get(std::size_t i, Vec3& root_position_m, std::span<Quat> rotations) const;
    /// After Encode: the pose is one that these codes can tell.
    [[nodiscard]] bool fits(std::size_t i) const { return fits_[i] != 0; }
    /// After Encode: its bytes, pose_bytes() of them; without meaning unless it fits.
    void CopyBytes(std::size_t i, std::span<std::byte> out) const;
    /// The same past the caches, which keep what is at hand, for who reads it much later: pieces of kPieceBytes, up to
    /// kMostBehind more than its bytes take, which mean nothing. `to` is a multiple of kPieceBytes; lines of the cache
    /// ought to be filled from one end to the other, for half of one is slow.
    void StreamBytes(std::size_t i, std::size_t pieces, std::byte* to) const;

   private:
    friend class CompactCodec;
    // One number of each pose: a line of the cache, so that no vector lies across two.
    struct alignas(64) Floats {
      float of[kBlock];
    };
    struct alignas(64) Words {
      std::uint32_t of[kBlock];
    };
    std::size_t size_ = 0;
    std::size_t joint_count_ = 0;
    float roots_m_[3][kBlock] = {};
    std::vector<Floats> rotations_;  // [joint][x y z w]
    std::vector<Floats> errors_;     // [joint][x y z]
    std::vector<Words> numbers_;     // [CompactPart::row]
    std::vector<Words> words_;       // [word / 4]: [pose][word % 4]
    std::uint32_t fits_[kBlock] = {};
  };

  /// Encodes what was added, all of joint_count() joints. Not every pose fits: one whose joints turn out of the codes'
  /// ranges, whose root is beyond kMaxRootM, or with a number that is not finite or a quaternion not unit within 1e-5.
  void Encode(Block& block) const;
  /// The same of poses that lie elsewhere; of the block's own nothing is left.
  void Encode(const Lanes& poses, Block& block) const;

  /// Reads one pose of pose_bytes() bytes, of any alignment; `rotations` has joint_count() entries and come back unit to
  /// float32. kShapeMismatch: another size; kOutOfRange: the root; kMalformed: bits that no encoder writes.
  [[nodiscard]] Status Decode(std::span<const std::byte> in, Vec3& root_position_m,
                              std::span<Quat> rotations) const;

 private:
  CompactCodec() = default;

  std::vector<CompactJoint> joints_;
  std::vector<std::uint16_t> order_;  // of encoding
  std::vector<CompactPart> parts_;    // of a pose's words, one after the other
  std::size_t pose_bytes_ = 0;
};

}  // namespace stridewire::protocol
