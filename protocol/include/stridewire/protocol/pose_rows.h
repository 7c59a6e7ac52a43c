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

/// The encoded poses of one tick. Each pose is encoded once and copied into any number of batches
/// by PoseBatchComposer.
///
///   avatars   7    8    11   15         ascending; shared, because the list rarely changes
///   flags     0    2    0    0
///   begins    0   150  150  301  450    begin of each row, and the end; avatar 8 has no pose
///   bytes     [ pose 7 ][ pose 11 ][ pose 15 ]
///
/// Rows may differ in length. Reuses its memory for every tick. Not thread-safe while rows are
/// added; afterwards any number of threads may read.
class PoseRows {
 public:
  using Avatars = std::shared_ptr<const std::vector<AvatarId>>;

  /// Removes all rows and starts a tick. In `info`, `part` must be 0 and `parts` 1. `avatars` must
  /// not be null; its ids must be ascending and above 0. Compact modes need `codec`, which must
  /// outlive all calls of Add. Fails with the errors of Check(PoseBatch), and with kInvalidArgument
  /// if the codec is missing or has another number of joints.
  [[nodiscard]] Status Begin(const PoseBatchInfo& info, Avatars avatars,
                             const CompactCodec* codec = nullptr);

  /// Encodes the pose of the next avatar as a new row. On failure the row is empty. A pose that
  /// does not fit a compact mode is stored uncompressed. Fails with the errors of EncodePose, and
  /// with kShapeMismatch for another number of joints. To encode many poses at once, use
  /// CompactCodec and AddEncoded.
  [[nodiscard]] Status Add(std::uint8_t flags, const Vec3& root_position_m,
                           std::span<const Quat> rotations);
  /// Adds a row with the encoded pose of the next avatar. The pose has the layout of info().mode,
  /// or of kQuantised if `is_uncompressed`. An empty span adds an empty row.
  void AddEncoded(std::uint8_t flags, bool is_uncompressed, std::span<const std::byte> pose);
  /// Adds empty rows until there are `row` rows.
  void SkipTo(std::size_t row);

  [[nodiscard]] const PoseBatchInfo& info() const { return info_; }
  [[nodiscard]] const Avatars& avatars() const { return avatars_; }
  [[nodiscard]] std::size_t size() const { return flags_.size(); }  ///< Number of rows.
  /// Returns the number of rows that are not empty.
  [[nodiscard]] std::size_t pose_count() const { return pose_count_; }
  [[nodiscard]] std::uint8_t flags(std::size_t row) const { return flags_[row]; }
  [[nodiscard]] bool has_pose(std::size_t row) const { return begins_[row] < begins_[row + 1]; }
  /// Returns the bytes of the rows from `first` to `last`, inclusive.
  [[nodiscard]] std::span<const std::byte> poses(std::size_t first, std::size_t last) const {
    return std::span(bytes_).subspan(begins_[first], begins_[last + 1] - begins_[first]);
  }

 private:
  PoseBatchInfo info_;
  Avatars avatars_;
  std::vector<std::uint8_t> flags_;
  std::vector<std::size_t> begins_;
  // The encoded rows. The array may be longer than all rows together: it never shrinks, because
  // resizing it would clear new bytes.
  std::vector<std::byte> bytes_;
  std::size_t pose_count_ = 0;

  std::span<std::byte> Room(std::size_t begin, std::size_t length);
  const CompactCodec* codec_ = nullptr;  // Codec of the poses; not null in compact modes
  CompactCodec::Block block_;
};

/// Copies rows of PoseRows into frames. Reuses its memory: after the first frames, it allocates
/// only memory for `frame`. Not thread-safe.
class PoseBatchComposer {
 public:
  explicit PoseBatchComposer(const FrameLimits& limits = {});
  ~PoseBatchComposer();
  PoseBatchComposer(PoseBatchComposer&&) noexcept;
  PoseBatchComposer& operator=(PoseBatchComposer&&) noexcept;

  /// Returns how many rows fit in one frame, starting with the first of `picked`. `picked` contains
  /// row indices in ascending order.
  [[nodiscard]] std::size_t CountThatFit(const PoseRows& rows,
                                         std::span<const std::uint32_t> picked) const;

  /// Header fields of a frame that differ between the frames of a tick.
  struct Slice {
    std::size_t part = 0;     ///< Index of the frame, less than `parts`.
    std::size_t parts = 1;    ///< Number of frames into which the batch is divided.
    bool is_partial = false;  ///< True if avatars that are not in the batch may still exist.
  };

  /// Appends a frame with the picked rows that are not empty. If there are none, the frame contains
  /// an empty batch. Fails with the errors of Check(PoseBatch), and with kLimitExceeded if the rows
  /// do not fit in one frame.
  [[nodiscard]] Status Compose(const PoseRows& rows, std::span<const std::uint32_t> picked,
                               const Slice& slice, std::vector<std::byte>& frame);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stridewire::protocol
