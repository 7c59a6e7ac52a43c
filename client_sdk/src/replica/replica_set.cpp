#include "replica_set.h"

#include <algorithm>
#include <utility>

#include "base/check.h"

namespace stridewire::client {

ReplicaSet::ReplicaSet(std::shared_ptr<const MotionLibrary> library, double tick_s,
                       std::size_t max_avatars)
    : library_(std::move(library)),
      tick_s_(tick_s),
      max_avatars_(max_avatars),
      evaluator_(*library_),
      plan_scratch_(*library_) {
  STRIDEWIRE_CHECK(tick_s > 0.0);
}

// Forgets the shard's avatars if `message` does not follow the last message that was applied.
void ReplicaSet::Synchronize(const protocol::Movements& message, Shard& shard, PoseSink& sink) {
  const std::uint64_t previous_step = message.states ? message.step : message.step - 1;
  const std::uint16_t part = message.states ? 0 : message.part;
  if (shard.is_synchronized && previous_step == shard.step && part == shard.parts_applied) return;
  for (const auto& [id, avatar] : shard.avatars) sink.OnGone(id);
  STRIDEWIRE_CHECK(avatar_count_ >= shard.avatars.size());
  avatar_count_ -= shard.avatars.size();
  shard = {.is_synchronized = true, .step = previous_step, .parts_applied = part, .avatars = {}};
}

Status ReplicaSet::ApplyRecord(const protocol::Movements& message, std::size_t i, Shard& shard,
                               PoseSink& sink) {
  const protocol::AvatarId id = message.avatars[i];
  if ((message.flags[i] & protocol::kMovementGone) != 0) {
    if (shard.avatars.erase(id) > 0) {
      --avatar_count_;
      sink.OnGone(id);
    }
    return {};
  }
  auto found = shard.avatars.find(id);
  if (found == shard.avatars.end()) {
    // A change is useless without the state that it changes. The server sends that state later.
    const bool is_state = AvatarReplica::IsState(message.record(i));
    if (!is_state || !sink.Wants(id) || avatar_count_ >= max_avatars_) return {};
    found = shard.avatars.emplace(id, Avatar{std::make_unique<AvatarReplica>(library_)}).first;
    ++avatar_count_;
  }
  if ((message.flags[i] & protocol::kPoseDiscontinuity) != 0) found->second.discontinuity = true;
  return found->second.replica->Apply(message.record(i), plan_scratch_);
}

void ReplicaSet::EmitPose(const protocol::Movements& message, protocol::AvatarId id, Avatar& avatar,
                          PoseSink& sink) {
  const PoseStamp stamp{.tick = message.tick,
                        .time_s = message.server_time_s,
                        .discontinuity = std::exchange(avatar.discontinuity, false),
                        .standing = avatar.replica->idle()};
  sink.OnPose(id, message.shard, stamp, avatar.replica->pose());
}

void ReplicaSet::CheckAvatarCount() const {
  std::size_t count = 0;
  for (const auto& [id, shard] : shards_) count += shard.avatars.size();
  STRIDEWIRE_CHECK(count == avatar_count_ && count <= max_avatars_);
}

Status ReplicaSet::Apply(const protocol::Movements& message, PoseSink& sink) {
  if (!shards_.contains(message.shard) && shards_.size() == kMaxShards) {
    return Fail(ErrorCode::kLimitExceeded, "movements come from too many shards", message.shard);
  }
  Shard& shard = shards_[message.shard];
  Synchronize(message, shard, sink);
  for (std::size_t i = 0; i < message.avatars.size(); ++i) {
    if (Status status = ApplyRecord(message, i, shard, sink); !status) return status;
  }
  CheckAvatarCount();
  if (message.states) {
    due_.assign(message.avatars.begin(), message.avatars.end());
    std::ranges::sort(due_);
    due_.erase(std::ranges::unique(due_).begin(), due_.end());
    std::erase_if(due_, [&](protocol::AvatarId id) { return !shard.avatars.contains(id); });
    scratch_.clear();
    for (const protocol::AvatarId id : due_) {
      scratch_.push_back(shard.avatars.at(id).replica.get());
    }
    AvatarReplica::AdvanceAll(scratch_, tick_s_, evaluator_);
    for (const protocol::AvatarId id : due_) EmitPose(message, id, shard.avatars.at(id), sink);
    return {};
  }
  if (++shard.parts_applied < message.parts) return {};
  shard.parts_applied = 0;
  shard.step = message.step;
  scratch_.clear();
  for (auto& [id, avatar] : shard.avatars) scratch_.push_back(avatar.replica.get());
  AvatarReplica::AdvanceAll(scratch_, tick_s_, evaluator_);
  if (message.more_steps > 0) return {};
  for (auto& [id, avatar] : shard.avatars) EmitPose(message, id, avatar, sink);
  return {};
}

}  // namespace stridewire::client
