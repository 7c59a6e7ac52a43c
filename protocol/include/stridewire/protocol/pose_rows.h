#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/protocol/compact_codec.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// The poses of a tick, each encoded once, to be put into any number of batches (PoseBatchComposer):
///
///   avatars   7    8    11   15         growing; shared, for they are seldom others
///   flags     0    2    0    0
///   begins    0   150  150  301  450    of the bytes of each, and their end; 8 has none
///   bytes     [ pose 7 ][ pose 11 ][ pose 15 ]
///
/// Rows may be of different lengths. Keeps its memory from one tick to the next. Not thread-safe while it
/// is filled; afterwards any number of threads may read.
class PoseRows {
 public:
  using Avatars = std::shared_ptr<const std::vector<AvatarId>>;

  /// Starts anew; drops what was there. `info` with part 0 of 1; `avatars` not null, growing, none of them
  /// 0. Compact rows need the world's codec, which has to live as long as poses are added. Errors as Check(PoseBatch), or
  /// kInvalidArgument: no codec, or one of another number of joints.
  [[nodiscard]] Status Begin(const PoseBatchInfo& info, Avatars avatars,
                             const CompactCodec* codec = nullptr);

  /// Makes the next row: the pose of the next avatar, encoded by EncodePose with its errors, after which
  /// the row is there but empty. kShapeMismatch: another number of joints. There must be an avatar left.
  /// A compact pose that does not fit is a wide one. Who has many encodes them side by side (CompactCodec).
  [[nodiscard]] Status Add(std::uint8_t flags, const Vec3& root_position_m,
                           std::span<const Quat> rotations);
  /// Makes the next row of bytes that are encoded already, in info().mode or, wide, in kQuantised; none: a row without a
  /// pose. There must be an avatar left.
  void AddEncoded(std::uint8_t flags, bool is_wide, std::span<const std::byte> pose);
  /// Makes the rows before the `row`th without a pose.
  void SkipTo(std::size_t row);

  [[nodiscard]] const PoseBatchInfo& info() const { return info_; }
  [[nodiscard]] const Avatars& avatars() const { return avatars_; }
  [[nodiscard]] std::size_t size() const { return flags_.size(); }      ///< Rows made.
  [[nodiscard]] std::size_t pose_count() const { return pose_count_; }  ///< Those not empty.
  [[nodiscard]] std::uint8_t flags(std::size_t row) const { return flags_[row]; }
  [[nodiscard]] bool has_pose(std::size_t row) const { return begins_[row] < begins_[row + 1]; }
  [[nodiscard]] std::span<const std::byte> poses(std::size_t first, std::size_t last) const {
    return std::span(bytes_).subspan(begins_[first], begins_[last + 1] - begins_[first]);
  }

 private:
  PoseBatchInfo info_;
  Avatars avatars_;
  std::vector<std::uint8_t> flags_;
  std::vector<std::size_t> begins_;
  std::vector<std::byte> bytes_;  // longer than what is used of it, so that it is not zeroed again
  std::size_t pose_count_ = 0;

  std::span<std::byte> Room(std::size_t begin, std::size_t length);
  const CompactCodec* codec_ = nullptr;  // of compact poses
  CompactCodec::Block block_;
};

/// Puts rows into frames: copies, nothing is encoded again. Keeps its memory between frames: once warm
/// nothing but `frame` allocates. Not thread-safe.
class PoseBatchComposer {
 public:
  explicit PoseBatchComposer(const FrameLimits& limits = {});
  ~PoseBatchComposer();
  PoseBatchComposer(PoseBatchComposer&&) noexcept;
  PoseBatchComposer& operator=(PoseBatchComposer&&) noexcept;

  /// How many of `picked` (row indices, growing), from the first on, one frame holds.
  [[nodiscard]] std::size_t Fitting(const PoseRows& rows,
                                    std::span<const std::uint32_t> picked) const;

  /// What a frame says about itself beside what all rows have in common.
  struct Slice {
    std::size_t part = 0;
    std::size_t parts = 1;
    bool is_partial = false;
  };

  /// Appends a frame with the picked rows that are not empty; there may be none. Errors as Check(PoseBatch), or kLimitExceeded: more than one frame holds.
  [[nodiscard]] Status Compose(const PoseRows& rows, std::span<const std::uint32_t> picked,
                               const Slice& slice, std::vector<std::byte>& frame);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stridewire::protocol
