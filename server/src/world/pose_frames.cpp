#include "world/pose_frames.h"

#include <algorithm>
#include <utility>

#include "base/check.h"

namespace stridewire::server {

std::vector<SharedFrame> ComposeFrames(protocol::PoseBatchComposer& composer,
                                       const protocol::PoseRows& rows,
                                       std::span<const std::uint32_t> picked, bool is_partial,
                                       ThreadMetrics& metrics) {
  const auto compose = [&](std::span<const std::uint32_t> of_part, std::size_t part,
                           std::size_t parts) {
    auto frame = std::make_shared<std::vector<std::byte>>();
    const Status composed = composer.Compose(
        rows, of_part, {.part = part, .parts = parts, .is_partial = is_partial}, *frame);
    STRIDEWIRE_CHECK(composed.has_value());
    return SharedFrame(std::move(frame));
  };
  std::vector<std::span<const std::uint32_t>> parts;
  std::size_t fitting = composer.CountThatFit(rows, picked);
  if (fitting == picked.size()) return {compose(picked, 0, 1)};
  while (!picked.empty() && parts.size() < protocol::kMaxBatchParts) {
    STRIDEWIRE_CHECK(fitting > 0);  // Every frame limit has room for poses of kMaxJoints joints.
    parts.push_back(picked.first(fitting));
    picked = picked.subspan(fitting);
    fitting = composer.CountThatFit(rows, picked);
  }
  metrics.pose_errors.Add(picked.size());
  std::vector<SharedFrame> frames;
  for (std::size_t part = 0; part < parts.size(); ++part) {
    frames.push_back(compose(parts[part], part, parts.size()));
  }
  return frames;
}

protocol::PoseRows& RowsPool::Take() {
  taken_ = nullptr;
  for (std::shared_ptr<Item>& item : items_) {
    if (item == nullptr) item = std::make_shared<Item>();
    if (!item->is_shared.load(std::memory_order_acquire)) {
      taken_ = item;
      break;
    }
  }
  if (taken_ == nullptr) taken_ = std::make_shared<Item>();
  return taken_->rows;
}

std::shared_ptr<const protocol::PoseRows> RowsPool::Share() {
  STRIDEWIRE_CHECK(taken_ != nullptr);
  STRIDEWIRE_CHECK(!taken_->is_shared.load(std::memory_order_relaxed));
  taken_->is_shared.store(true, std::memory_order_relaxed);
  const protocol::PoseRows* rows = &taken_->rows;
  return {rows, [item = std::exchange(taken_, nullptr)](const protocol::PoseRows*) {
            item->is_shared.store(false, std::memory_order_release);
          }};
}

}  // namespace stridewire::server
