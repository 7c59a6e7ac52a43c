#include "net/send_queue.h"

#include <algorithm>
#include <utility>

#include "base/check.h"

namespace stridewire::server {
namespace {

// Maximum number of frames of each kind per write. A system call accepts 1024 buffers (IOV_MAX).
constexpr std::size_t kMaxGatheredFrames = 64;

}  // namespace

SendQueue::SendQueue(std::size_t control_budget_bytes, int backlog_ticks)
    : control_budget_bytes_(control_budget_bytes),
      backlog_ticks_(static_cast<std::size_t>(backlog_ticks)) {
  STRIDEWIRE_CHECK(backlog_ticks >= 1);
}

void SendQueue::Gathered::clear() {
  frames.clear();
  stream_frames = 0;
  bytes = 0;
  poses = 0;
  batches = 0;
}

void SendQueue::PushControl(SharedFrame frame) {
  STRIDEWIRE_CHECK(frame != nullptr);
  control_bytes_ += frame->size();
  control_.push_back(std::move(frame));
}

bool SendQueue::PushEvents(SharedFrame frame) {
  if (control_bytes_ + frame->size() > control_budget_bytes_) return false;
  PushControl(std::move(frame));
  return true;
}

void SendQueue::PushTerrain(WorldId world, SharedFrame frame) {
  STRIDEWIRE_CHECK(frame != nullptr);
  terrains_.insert_or_assign(world, std::move(frame));
}

std::size_t SendQueue::PushPoses(PoseFrames&& batch) {
  STRIDEWIRE_CHECK(!batch.frames.empty());
  Lane& lane = lanes_[{batch.world, batch.mode, batch.shard}];
  std::size_t dropped = 0;
  while (lane.size() >= backlog_ticks_) {
    dropped += lane.front().left();
    lane.pop_front();
  }
  STRIDEWIRE_CHECK(dropped <= waiting_pose_frames_);
  waiting_pose_frames_ += batch.frames.size();
  waiting_pose_frames_ -= dropped;
  lane.push_back({std::move(batch.frames), 0, batch.avatar_count});
  return dropped;
}

template <typename Predicate>
std::size_t SendQueue::EraseMovements(Predicate&& predicate) {
  const std::size_t erased = std::erase_if(movements_, [&](const QueuedMovements& queued) {
    if (!predicate(queued)) return false;
    STRIDEWIRE_CHECK(queued.frame->size() <= movement_bytes_);
    movement_bytes_ -= queued.frame->size();
    return true;
  });
  STRIDEWIRE_CHECK(!movements_.empty() || movement_bytes_ == 0);
  return erased;
}

std::size_t SendQueue::PushMovements(WorldId world, int shard, SharedFrame frame) {
  if (movement_bytes_ + frame->size() > control_budget_bytes_) {
    return 1 + EraseMovements([&](const QueuedMovements& queued) {
             return queued.world == world && queued.shard == shard;
           });
  }
  movement_bytes_ += frame->size();
  movements_.push_back({world, shard, std::move(frame)});
  return 0;
}

void SendQueue::DropMovements(WorldId world) {
  EraseMovements([&](const QueuedMovements& queued) { return queued.world == world; });
}

void SendQueue::DropPoses(WorldId world, protocol::PoseMode mode) {
  std::erase_if(lanes_, [&](const auto& item) {
    if (item.first.world != world || item.first.mode != mode) return false;
    for (const Batch& batch : item.second) {
      STRIDEWIRE_CHECK(batch.left() > 0 && batch.left() <= waiting_pose_frames_);
      waiting_pose_frames_ -= batch.left();
    }
    return true;
  });
}

void SendQueue::DropAllPoses() {
  lanes_.clear();
  waiting_pose_frames_ = 0;
}

void SendQueue::Gather(std::size_t max_bytes, Gathered& out) {
  out.clear();
  while (!control_.empty() && out.bytes < max_bytes && out.frames.size() < kMaxGatheredFrames) {
    control_bytes_ -= control_.front()->size();
    out.bytes += control_.front()->size();
    out.frames.push_back(std::move(control_.front()));
    control_.pop_front();
  }
  if (control_.empty() && !terrains_.empty()) {
    out.bytes += terrains_.begin()->second->size();
    out.frames.push_back(std::move(terrains_.begin()->second));
    terrains_.erase(terrains_.begin());
  }
  const std::size_t other_frames = out.frames.size();
  std::size_t taken_bytes = 0;
  for (std::size_t i = 0; !movements_.empty() && taken_bytes < max_bytes && i < kMaxGatheredFrames;
       ++i) {
    taken_bytes += movements_.front().frame->size();
    out.frames.push_back(std::move(movements_.front().frame));
    movements_.pop_front();
  }
  STRIDEWIRE_CHECK(taken_bytes <= movement_bytes_);
  movement_bytes_ -= taken_bytes;
  out.bytes += taken_bytes;
  std::size_t pose_bytes = 0;
  std::size_t pose_frames = 0;
  auto lane = lanes_.upper_bound(last_lane_);
  while (waiting_pose_frames_ > 0 && pose_bytes < max_bytes && pose_frames < kMaxGatheredFrames) {
    if (lane == lanes_.end()) lane = lanes_.begin();
    if (!lane->second.empty()) {
      Batch& batch = lane->second.front();
      SharedFrame frame = std::move(batch.parts[batch.next_part++]);
      pose_bytes += frame->size();
      ++pose_frames;
      --waiting_pose_frames_;
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
  out.stream_frames = out.frames.size() - other_frames;
  STRIDEWIRE_CHECK(!control_.empty() || control_bytes_ == 0);
  STRIDEWIRE_CHECK(!movements_.empty() || movement_bytes_ == 0);
}

}  // namespace stridewire::server
