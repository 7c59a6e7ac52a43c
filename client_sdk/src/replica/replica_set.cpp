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

void ReplicaSet::EndContinued(PoseSink& sink) {
  for (const protocol::AvatarId id : sink.TakeEnded()) {
    for (auto& [number, shard] : shards_) {
      const auto found = std::ranges::lower_bound(shard.avatars, id, {}, &Avatar::id);
      if (found != shard.avatars.end() && found->id == id) found->is_ended = true;
    }
  }
}

// Discards the avatars of the shard. Later messages of changes have no effect on them until the
// server sends their states.
void ReplicaSet::Discard(Shard& shard, PoseSink& sink) {
  for (const Avatar& avatar : shard.avatars) sink.OnGone(avatar.id);
  STRIDEWIRE_CHECK(avatar_count_ >= shard.avatars.size());
  avatar_count_ -= shard.avatars.size();
  shard = {};
}

// Discards the shard's avatars if `message` does not follow the last message that was applied.
void ReplicaSet::Synchronize(const protocol::Movements& message, Shard& shard, PoseSink& sink) {
  const std::uint64_t previous_step = message.states ? message.step : message.step - 1;
  const std::uint16_t part = message.states ? 0 : message.part;
  if (shard.is_synchronized && previous_step == shard.step && part == shard.parts_applied) return;
  Discard(shard, sink);
  shard.is_synchronized = true;
  shard.step = previous_step;
  shard.parts_applied = part;
}

Status ReplicaSet::ApplyRecord(const protocol::Movements& message, std::size_t i, Shard& shard,
                               PoseSink& sink) {
  const protocol::AvatarId id = message.avatars[i];
  auto found = std::ranges::lower_bound(shard.avatars, id, {}, &Avatar::id);
  const bool is_known = found != shard.avatars.end() && found->id == id;
  if (is_known) CatchUp(*found, message.states ? message.step : message.step - 1);
  if ((message.flags[i] & protocol::kMovementGone) != 0) {
    if (is_known && found->replica != nullptr) {
      found->replica = nullptr;
      --avatar_count_;
      sink.OnGone(id);
    }
    return {};
  }
  if (!is_known || found->replica == nullptr) {
    // A change is useless without the state that it changes. The server sends that state later.
    const bool is_state = AvatarReplica::IsState(RecordOf(message, i));
    if (!is_state || !sink.Wants(id) || avatar_count_ >= max_avatars_) return {};
    if (!is_known) found = shard.avatars.insert(found, Avatar{.id = id});
    found->replica = std::make_unique<AvatarReplica>(library_);
    found->discontinuity = true;
    ++avatar_count_;
  }
  if ((message.flags[i] & protocol::kPoseDiscontinuity) != 0) found->discontinuity = true;
  return found->replica->Apply(RecordOf(message, i), plan_scratch_);
}

void ReplicaSet::CatchUp(Avatar& avatar, std::uint64_t step) const {
  if (!std::exchange(avatar.is_continued, false)) return;
  STRIDEWIRE_CHECK(step >= avatar.step);
  avatar.replica->SkipTicks(step - avatar.step, tick_s_);
}

void ReplicaSet::EmitPose(const protocol::Movements& message, Avatar& avatar, PoseSink& sink) {
  const PoseStamp stamp{.tick = message.tick,
                        .time_s = message.server_time_s,
                        .discontinuity = std::exchange(avatar.discontinuity, false),
                        .standing = avatar.replica->idle()};
  avatar.is_continued = sink.OnPose(avatar.id, message.shard, stamp, *avatar.replica);
  avatar.is_ended = false;
  avatar.step = message.step;
}

// Advances the avatars in `due_` by one tick. Passes their poses to the sink if `emits` is true and
// the sink needs the tick. If the message contains no states, the sink continues the movements of
// all other avatars of the shard.
void ReplicaSet::AdvanceDue(const protocol::Movements& message, Shard& shard, bool emits,
                            PoseSink& sink) {
  const std::uint64_t every_n_ticks = sink.EveryNTicks();
  const bool has_poses = emits && message.tick % every_n_ticks == 0;
  replicas_.clear();
  for (const Avatar* avatar : due_) replicas_.push_back(avatar->replica.get());
  AvatarReplica::AdvanceAll(replicas_,
                            {.length_s = tick_s_,
                             .number = message.step,
                             .has_poses = has_poses,
                             .ticks_apart = static_cast<int>(every_n_ticks),
                             .only_layered = sink.EvaluatesMovements()},
                            evaluator_);
  if (!has_poses) return;
  // The poses and the memory of the sink are usually not in the processor's cache. They are
  // prefetched this many avatars ahead.
  constexpr std::size_t kPrefetched = 2;
  const auto prefetch = [&](std::size_t i) {
    if (i >= due_.size()) return;
    if (!sink.EvaluatesMovements()) due_[i]->replica->PrefetchPose();
    sink.Prefetch(due_[i]->id);
  };
  for (std::size_t i = 0; i < kPrefetched; ++i) prefetch(i);
  const Avatar* continued = shard.avatars.data();
  const Avatar* const last = continued + shard.avatars.size();
  for (std::size_t i = 0; i <= due_.size(); ++i) {
    // Avatars are passed to the sink in ascending order of their ids.
    if (!message.states) {
      const Avatar* const end = i < due_.size() ? due_[i] : last;
      for (; continued != end; ++continued) sink.OnContinued(continued->id);
    }
    if (i == due_.size()) break;
    prefetch(i + kPrefetched);
    EmitPose(message, *due_[i], sink);
    if (!message.states) ++continued;
  }
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
  EndContinued(sink);
  Synchronize(message, shard, sink);
  Status status;
  for (std::size_t i = 0; i < message.avatars.size() && status; ++i) {
    status = ApplyRecord(message, i, shard, sink);
  }
  std::erase_if(shard.avatars, [](const Avatar& avatar) { return avatar.replica == nullptr; });
  CheckAvatarCount();
  if (!status) {
    Discard(shard, sink);
    return status;
  }
  due_.clear();
  if (message.states) {
    for (const protocol::AvatarId id : message.avatars) {
      const auto found = std::ranges::lower_bound(shard.avatars, id, {}, &Avatar::id);
      if (found != shard.avatars.end() && found->id == id) due_.push_back(&*found);
    }
    std::ranges::sort(due_);
    due_.erase(std::ranges::unique(due_).begin(), due_.end());
    AdvanceDue(message, shard, true, sink);
    return {};
  }
  if (++shard.parts_applied < message.parts) return {};
  shard.parts_applied = 0;
  shard.step = message.step;
  for (Avatar& avatar : shard.avatars) {
    if (avatar.is_continued && !avatar.is_ended) continue;
    CatchUp(avatar, message.step - 1);
    due_.push_back(&avatar);
  }
  AdvanceDue(message, shard, message.more_steps == 0, sink);
  return {};
}

}  // namespace stridewire::client
