#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Gathers the poses of a tick, full or quantised, into a frame:
///
///   encoder.Begin(info);
///   for (…) encoder.Add(avatar, flags, root_position_m, rotations);
///   encoder.Finish(frame);              // to be shared, unchanged, by every observer
///
/// Keeps its memory between batches: once warm nothing but `frame` may allocate. Not thread-safe.
class PoseBatchEncoder {
 public:
  explicit PoseBatchEncoder(const FrameLimits& limits = {});
  ~PoseBatchEncoder();
  PoseBatchEncoder(PoseBatchEncoder&&) noexcept;
  PoseBatchEncoder& operator=(PoseBatchEncoder&&) noexcept;

  /// How many avatars one frame holds: what a shard has beyond that goes into further parts.
  [[nodiscard]] std::size_t MaxAvatars(PoseMode mode, std::size_t joint_count) const;

  /// Starts a batch and drops an unfinished one. Errors as Check(PoseBatch).
  [[nodiscard]] Status Begin(const PoseBatchInfo& info);

  /// Adds one pose, encoded by EncodePose with its errors; after one the batch is as it was before
  /// and goes on without that avatar. kOutOfRange: avatar 0; kLimitExceeded: MaxAvatars reached;
  /// kShapeMismatch: another number of joints; kInvalidArgument: no batch begun.
  [[nodiscard]] Status Add(AvatarNumber avatar, std::uint8_t flags, const Vec3& root_position_m,
                           std::span<const Quat> rotations);

  [[nodiscard]] std::size_t size() const;  ///< Avatars added so far.

  /// Appends the frame with the avatars added (there may be none) and ends the batch.
  /// kInvalidArgument: no batch begun.
  [[nodiscard]] Status Finish(std::vector<std::byte>& frame);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stridewire::protocol
