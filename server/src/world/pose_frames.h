#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "net/shared_frame.h"
#include "ops/metrics.h"
#include "stridewire/protocol/pose_rows.h"

namespace stridewire::server {

/// Frames with the picked rows (indices, growing), in as many parts as it takes; one if there are none. Poses that
/// fit in no part, which needs a frame limit far below the default, are counted. `is_partial` as in PoseBatchInfo.
[[nodiscard]] std::vector<SharedFrame> ComposeFrames(protocol::PoseBatchComposer& composer,
                                                     const protocol::PoseRows& rows,
                                                     std::span<const std::uint32_t> picked,
                                                     bool is_partial, ThreadMetrics& metrics);

/// Rows that other threads read, filled again when they have done so. One thread takes and shares.
class RowsPool {
 public:
  /// Rows to be filled; they are its caller's until the next call.
  [[nodiscard]] protocol::PoseRows& Take();
  /// The rows last taken, from now on as they are.
  [[nodiscard]] std::shared_ptr<const protocol::PoseRows> Share();

 private:
  /// Ticks whose rows are read at the same time by shards that keep up. Beyond, they are made anew.
  static constexpr std::size_t kKept = 3;
  struct Slot {
    protocol::PoseRows rows;
    std::atomic<bool> is_shared{false};
  };
  std::array<std::shared_ptr<Slot>, kKept> kept_;
  std::shared_ptr<Slot> taken_;
};

}  // namespace stridewire::server
