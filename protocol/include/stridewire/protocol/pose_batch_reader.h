#pragma once

#include <cstddef>
#include <span>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/protocol/compact_codec.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Goes through the poses of a batch that was decoded, in the order of its avatars:
///
///   PoseBatchReader reader(batch, codec);
///   for (…) {
///     reader.Next();
///     reader.Decode(root_position_m, rotations);
///   }
///
/// Borrows both; never allocates.
class PoseBatchReader {
 public:
  /// `codec`: the world's for the batch's mode (CompactCodecs::Find), null if there is none.
  PoseBatchReader(const PoseBatch& batch, const CompactCodec* codec)
      : batch_(batch), codec_(codec), compact_bytes_(CompactPoseBytes(batch).value_or(0)) {}

  /// The bytes of the next pose; no more often than there are avatars.
  std::span<const std::byte> Next();

  /// Reads the pose that Next gave last. Errors as DecodePose and CompactCodec::Decode; kUnsupported: a compact pose
  /// without a codec.
  [[nodiscard]] Status Decode(Vec3& root_position_m, std::span<Quat> rotations) const;

 private:
  const PoseBatch& batch_;
  const CompactCodec* codec_;
  std::size_t compact_bytes_;
  std::size_t index_ = 0;
  std::size_t at_ = 0;
  PoseMode mode_ = PoseMode::kFull;  // of the last
  std::span<const std::byte> pose_;
};

}  // namespace stridewire::protocol
