#include "net/send_queue.h"

#include <algorithm>
#include <utility>

namespace stridewire::server {
namespace {

constexpr std::size_t kMaxGatheredFrames = 64;  // of either kind; a system call takes 1024 pieces

}  // namespace

SendQueue::SendQueue(std::size_t control_budget_bytes, int backlog_ticks)
    : control_budget_bytes_(control_budget_bytes),
      backlog_ticks_(static_cast<std::size_t>(std::max(backlog_ticks, 1))) {}

void SendQueue::Gathered::clear() {
  frames.clear();
  bytes = 0;
  poses = 0;
  batches = 0;
}

void SendQueue::PushControl(SharedFrame frame) {
  control_bytes_ += frame->size();
  control_.push_back(std::move(frame));
}

bool SendQueue::PushEvents(SharedFrame frame) {
  if (control_bytes_ + frame->size() > control_budget_bytes_) return false;
  PushControl(std::move(frame));
  return true;
}

void SendQueue::PushTerrain(WorldId world, SharedFrame frame) {
  grounds_.insert_or_assign(world, std::move(frame));
}

std::size_t SendQueue::PushPoses(const PoseDelivery& delivery) {
  Lane& lane = lanes_[{delivery.world, delivery.mode, delivery.from_shard}];
  std::size_t dropped = 0;
  while (lane.size() >= backlog_ticks_) {
    dropped += lane.front().left();
    lane.pop_front();
  }
  lane.push_back({delivery.parts, 0, delivery.avatar_count});
  waiting_batches_ += delivery.parts.size();
  waiting_batches_ -= dropped;
  return dropped;
}

template <typename IsIt>
std::size_t SendQueue::EraseMovements(IsIt&& is_it) {
  return std::erase_if(movements_, [&](const Told& told) {
    if (!is_it(told)) return false;
    movement_bytes_ -= told.frame->size();
    return true;
  });
}

std::size_t SendQueue::PushMovements(WorldId world, int shard, SharedFrame frame) {
  if (movement_bytes_ + frame->size() > control_budget_bytes_) {
    return 1 + EraseMovements(
                   [&](const Told& told) { return told.world == world && told.shard == shard; });
  }
  movement_bytes_ += frame->size();
  movements_.push_back({world, shard, std::move(frame)});
  return 0;
}

void SendQueue::DropMovements(WorldId world) {
  EraseMovements([&](const Told& told) { return told.world == world; });
}

void SendQueue::DropPoses(WorldId world, protocol::PoseMode mode) {
  std::erase_if(lanes_, [&](const auto& item) {
    if (item.first.world != world || item.first.mode != mode) return false;
    for (const Batch& batch : item.second) waiting_batches_ -= batch.left();
    return true;
  });
}

void SendQueue::DropAllPoses() {
  lanes_.clear();
  waiting_batches_ = 0;
}

void SendQueue::Gather(std::size_t max_bytes, Gathered& out) {
  out.clear();
  while (!control_.empty() && out.bytes < max_bytes && out.frames.size() < kMaxGatheredFrames) {
    control_bytes_ -= control_.front()->size();
    out.bytes += control_.front()->size();
    out.frames.push_back(std::move(control_.front()));
    control_.pop_front();
  }
  if (control_.empty() && !grounds_.empty()) {
    out.bytes += grounds_.begin()->second->size();
    out.frames.push_back(std::move(grounds_.begin()->second));
    grounds_.erase(grounds_.begin());
  }
  std::size_t told_bytes = 0;
  for (std::size_t i = 0; !movements_.empty() && told_bytes < max_bytes && i < kMaxGatheredFrames;
       ++i) {
    told_bytes += movements_.front().frame->size();
    out.frames.push_back(std::move(movements_.front().frame));
    movements_.pop_front();
  }
  movement_bytes_ -= told_bytes;
  out.bytes += told_bytes;
  std::size_t pose_bytes = 0;
  std::size_t pose_frames = 0;
  auto lane = lanes_.upper_bound(last_lane_);
  while (waiting_batches_ > 0 && pose_bytes < max_bytes && pose_frames < kMaxGatheredFrames) {
    if (lane == lanes_.end()) lane = lanes_.begin();
    if (!lane->second.empty()) {
      Batch& batch = lane->second.front();
      SharedFrame frame = std::move(batch.parts[batch.next_part++]);
      pose_bytes += frame->size();
      ++pose_frames;
      --waiting_batches_;
      out.frames.push_back(std::move(frame));
      ++out.batches;
      if (batch.left() == 0) {
        out.poses += batch.avatars;
        lane->second.pop_front();
      }
      last_lane_ = lane->first;
    }
    ++lane;
  }
  out.bytes += pose_bytes;
}

}  // namespace stridewire::server
