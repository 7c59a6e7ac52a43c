#pragma once

#include <cstddef>
#include <span>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/protocol/compact_codec.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Decodes the poses of a batch in the order of its avatars:
///
///   PoseBatchReader reader(batch, codec);
///   for (const AvatarId avatar : batch.avatars) {
///     reader.Next();
///     reader.Decode(root_position_m, rotations);
///   }
///
/// Borrows the batch and the codec. Never allocates.
class PoseBatchReader {
 public:
  /// `codec` is the codec of the batch's mode (CompactCodecs::Find). It may be null if the batch is
  /// not compact.
  PoseBatchReader(const PoseBatch& batch, const CompactCodec* codec)
      : batch_(batch), codec_(codec), compact_bytes_(CompactPoseBytes(batch).value_or(0)) {}

  /// Moves to the next pose and returns its bytes. Call it at most once per avatar.
  std::span<const std::byte> Next();

  /// Decodes the current pose. Fails with the errors of DecodePose and CompactCodec::Decode, and
  /// with kUnsupported for a compact pose without a codec.
  [[nodiscard]] Status Decode(Vec3& root_position_m, std::span<Quat> rotations) const;

 private:
  const PoseBatch& batch_;
  const CompactCodec* codec_;
  std::size_t compact_bytes_;
  std::size_t index_ = 0;            // Index of the next pose
  std::size_t at_ = 0;               // Offset of the next pose in batch_.poses
  PoseMode mode_ = PoseMode::kFull;  // Layout of the current pose
  std::span<const std::byte> pose_;
};

}  // namespace stridewire::protocol
