#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/base/rotation_quantization.h"

namespace stridewire::protocol {

/// Checks the quantizations of a WorldInfo: references are unit quaternions, numbers are finite and
/// within the limits of RotationQuantization, and the root uses "smallest three". An empty list
/// is valid. Fails with kOutOfRange, kMalformed or kLimitExceeded; Error::index is the joint.
[[nodiscard]] Status CheckRotationQuantizations(std::span<const RotationQuantization> codes);

/// Checks the joints of PoseDetail::kReduced. `parents` contains the parent of each joint of the
/// skeleton. `joints` must be ascending, and contain the root and the parent of every other joint
/// in the list. Fails with kShapeMismatch if there are more joints than in the skeleton. All other
/// errors are kMalformed, and Error::index is the position in `joints`.
[[nodiscard]] Status CheckReducedJoints(std::span<const std::uint16_t> joints,
                                        std::span<const std::int16_t> parents);

/// A RotationQuantization of one joint in the form that CompactCodec uses.
struct CompactJoint {
  float reference[4] = {};  ///< x, y, z, w
  float low[3] = {};        ///< Smallest x, y and z that can be encoded.
  /// Distance between adjacent values of x, y and z; with "smallest three", step[0] applies to all.
  float step[3] = {};
  float inverse_step[3] = {};  ///< 1 / step
  std::int32_t bits[3] = {};
  /// Bits per component with "smallest three" encoding; 0: x, y and z are encoded.
  std::int32_t smallest_three_bits = 0;
  float least_w = 0.0f;        ///< Smallest w that can be encoded, if x, y and z are encoded.
  std::int32_t parent = -1;    ///< Index of the parent joint; -1 for the root.
  bool has_reference = false;  ///< True if `reference` is not the identity.
  bool has_children = false;
  /// True if poses do not contain the joint. It is then decoded to `reference`.
  bool is_omitted = false;
};

/// A part of a 32-bit word of an encoded pose: some bits of one of the numbers that make up the
/// pose.
struct CompactPart {
  std::uint16_t row = 0;  ///< Index of the number in the pose.
  /// Number of bits by which to shift the number left; negative: to the right.
  std::int8_t left = 0;
  bool ends_word = false;  ///< True for the last part of a word.
};

/// Encodes and decodes compact poses (STANDARD.md, "Poses"): the quantised root, followed by the
/// bits of each joint without gaps, lowest bit first, in little-endian words of 16 bits. The unused
/// bits of the last word are 0.
///
/// The encoder starts at the root and encodes each joint relative to the decoded rotation of its
/// parent. A joint therefore corrects the errors of its ancestors, and only its own error remains
/// in its world rotation.
class CompactCodec {
 public:
  /// Number of poses that are encoded together.
  static constexpr std::size_t kBlock = 16;
  /// Block::StreamBytes writes poses in pieces of this size.
  static constexpr std::size_t kPieceBytes = 16;
  /// Block::StreamBytes can write up to this many pieces after the end of a pose.
  static constexpr std::size_t kMaxTrailingPieces = 3;

  /// `codes` and `parents` have one entry per joint. The parent of the root is -1; every other
  /// parent has a lower index than its joint. A pose contains the joints in `included`, or all
  /// joints if `included` is empty. Fails with the errors of CheckRotationQuantizations and
  /// CheckReducedJoints, with kShapeMismatch if `codes` and `parents` differ in length or are
  /// empty, and with kOutOfRange for an invalid parent.
  [[nodiscard]] static Expected<CompactCodec> Make(std::span<const RotationQuantization> codes,
                                                   std::span<const std::int16_t> parents,
                                                   std::span<const std::uint16_t> included = {});

  [[nodiscard]] std::size_t joint_count() const { return joints_.size(); }
  /// Size of a pose in bytes.
  [[nodiscard]] std::size_t pose_bytes() const { return pose_bytes_; }
  /// Number of pieces of kPieceBytes that a pose needs.
  [[nodiscard]] std::size_t pieces() const { return (pose_bytes_ + kPieceBytes - 1) / kPieceBytes; }

  /// Poses in structure-of-arrays layout, each with joint_count() joints.
  struct SoaPoses {
    const float* roots_m;    ///< [x y z][kBlock]
    const float* rotations;  ///< [joint][x y z w][kBlock]
    std::size_t count;       ///< Number of valid poses, at most kBlock.
    /// True: the caller guarantees that rotations are unit quaternions or NaN, so the encoder does
    /// not check their lengths.
    bool are_unit = false;
  };

  /// Up to kBlock poses and their encoded bytes. Reuse a block: it allocates only for skeletons
  /// with more joints than before.
  class Block {
   public:
    [[nodiscard]] std::size_t size() const { return size_; }
    /// Removes all poses.
    void Clear() { size_ = 0; }
    /// Adds a copy of a pose. The block must have fewer than kBlock poses.
    void Add(const Vec3& root_position_m, std::span<const Quat> rotations);
    /// Gets the i-th pose as it was added.
    void Get(std::size_t i, Vec3& root_position_m, std::span<Quat> rotations) const;
    /// After Encode: returns whether the pose is inside the range of the quantizations.
    [[nodiscard]] bool fits(std::size_t i) const { return fits_[i] != 0; }
    /// After Encode: copies the pose_bytes() bytes of a pose. They are unspecified unless fits(i).
    void CopyBytes(std::size_t i, std::span<std::byte> out) const;
    /// Same as CopyBytes with non-temporal stores, which bypass the caches; for bytes that are read
    /// much later. Writes `pieces` pieces, at most kMaxTrailingPieces more than the pose needs; the
    /// contents of excess pieces are unspecified. `to` is aligned to kPieceBytes. Choose `pieces`
    /// so that whole cache lines are written: writing part of a line is slow.
    void StreamBytes(std::size_t i, std::size_t pieces, std::byte* to) const;

   private:
    friend class CompactCodec;
    // One component of the poses, for all poses of a block. The alignment prevents SIMD loads and
    // stores that cross cache lines.
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

  /// Encodes the poses of a block, which must have joint_count() joints. A pose does not fit if a
  /// rotation is outside the range of its quantization, the magnitude of a coordinate of the root
  /// exceeds kMaxRootM, a number is not finite, or the length of a quaternion deviates from 1 by
  /// more than 1e-5.
  void Encode(Block& block) const;
  /// Encodes poses of the caller instead of those that Add has added. Get does not return them.
  void Encode(const SoaPoses& poses, Block& block) const;

  /// Decodes a pose. `in` needs no alignment. Rotations are unit to float32 precision. Fails with
  /// kShapeMismatch if a size is wrong, kOutOfRange if the root is out of range, and kMalformed
  /// for bits that no encoder writes.
  [[nodiscard]] Status Decode(std::span<const std::byte> in, Vec3& root_position_m,
                              std::span<Quat> rotations) const;

 private:
  CompactCodec() = default;

  std::vector<CompactJoint> joints_;
  std::vector<std::uint16_t> order_;  // Order in which joints are encoded
  std::vector<CompactPart> parts_;    // Contents of the 32-bit words of a pose, in order
  std::size_t pose_bytes_ = 0;
};

}  // namespace stridewire::protocol
