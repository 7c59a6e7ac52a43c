#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/metrics.h"
#include "net/shared_frame.h"
#include "stridewire/protocol/pose_rows.h"

namespace stridewire::server {

/// Composes a pose batch of the rows `picked`, which are ascending indices. Returns one frame, or
/// several if the batch exceeds the frame limit. An empty batch is one frame. If the frame limit is
/// far below the default, some poses may not fit into the maximum number of frames. They are
/// omitted and counted in `metrics`. `is_partial`: see protocol::PoseBatchInfo.
[[nodiscard]] std::vector<SharedFrame> ComposeFrames(protocol::PoseBatchComposer& composer,
                                                     const protocol::PoseRows& rows,
                                                     std::span<const std::uint32_t> picked,
                                                     bool is_partial, ThreadMetrics& metrics);

/// Reuses the memory of PoseRows that other threads read. Only one thread may call Take and Share.
class RowsPool {
 public:
  /// Returns rows to fill. They belong to the caller until the next call.
  [[nodiscard]] protocol::PoseRows& Take();
  /// Returns the rows of the last Take as read-only. After the last reader has released them, Take
  /// reuses them.
  [[nodiscard]] std::shared_ptr<const protocol::PoseRows> Share();

 private:
  /// Number of ticks whose rows can be in use at the same time. If shards fall behind further, Take
  /// allocates.
  static constexpr std::size_t kPooled = 3;
  struct Item {
    protocol::PoseRows rows;
    std::atomic<bool> is_shared{false};
  };
  std::array<std::shared_ptr<Item>, kPooled> items_;
  std::shared_ptr<Item> taken_;
};

}  // namespace stridewire::server
