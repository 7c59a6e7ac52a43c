#include "replica_set.h"

#include <utility>

namespace stridewire::client {

ReplicaSet::ReplicaSet(std::shared_ptr<const MotionLibrary> library, double tick_s,
                       std::size_t max_avatars)
    : library_(std::move(library)),
      tick_s_(tick_s),
      max_avatars_(max_avatars),
      evaluator_(*library_, 1),
      plan_scratch_(*library_) {}

std::size_t ReplicaSet::avatar_count() const {
  std::size_t count = 0;
  for (const auto& [number, shard] : shards_) count += shard.avatars.size();
  return count;
}

Status ReplicaSet::Apply(const protocol::Movements& message, std::size_t i, Shard& shard,
                         PoseSink& screen) {
  const protocol::AvatarId avatar = message.avatars[i];
  if ((message.flags[i] & protocol::kMovementGone) != 0) {
    if (shard.avatars.erase(avatar) > 0) screen.Gone(avatar);
    return {};
  }
  auto told = shard.avatars.find(avatar);
  if (told == shard.avatars.end()) {
    // Of who is not known a change says nothing; the state is on its way.
    if (!AvatarReplica::IsState(message.record(i)) || !screen.Wants(avatar) ||
        avatar_count() >= max_avatars_) {
      return {};
    }
    told = shard.avatars.emplace(avatar, Told{std::make_unique<AvatarReplica>(library_)}).first;
  }
  if ((message.flags[i] & protocol::kPoseDiscontinuity) != 0) told->second.is_new = true;
  return told->second.replica->Apply(message.record(i), plan_scratch_);
}

void ReplicaSet::Show(const protocol::Movements& message, protocol::AvatarId avatar, Told& told,
                      PoseSink& screen) {
  const PoseStamp stamp{.tick = message.tick,
                        .time_s = message.server_time_s,
                        .discontinuity = std::exchange(told.is_new, false),
                        .standing = told.replica->idle()};
  screen.Show(avatar, message.shard, stamp, told.replica->pose());
}

Status ReplicaSet::Take(const protocol::Movements& message, PoseSink& screen) {
  if (!shards_.contains(message.shard) && shards_.size() == kMaxShards) {
    return Fail(ErrorCode::kLimitExceeded, "movements come from too many shards", message.shard);
  }
  Shard& shard = shards_[message.shard];
  const std::uint64_t follows = message.states ? message.step : message.step - 1;
  const std::uint16_t part = message.states ? 0 : message.part;
  if (!shard.is_known || follows != shard.step || part != shard.parts_taken) {
    for (const auto& [avatar, told] : shard.avatars) screen.Gone(avatar);
    shard = {.is_known = true, .step = follows, .parts_taken = part, .avatars = {}};
  }
  scratch_.clear();
  for (std::size_t i = 0; i < message.avatars.size(); ++i) {
    if (Status status = Apply(message, i, shard, screen); !status) return status;
  }
  if (message.states) {
    for (const protocol::AvatarId avatar : message.avatars) {
      const auto told = shard.avatars.find(avatar);
      if (told == shard.avatars.end()) continue;
      AvatarReplica* replica = told->second.replica.get();
      AvatarReplica::AdvanceAll(std::span(&replica, 1), tick_s_, evaluator_);
      Show(message, avatar, told->second, screen);
    }
    return {};
  }
  if (++shard.parts_taken < message.parts) return {};
  shard.parts_taken = 0;
  shard.step = message.step;
  for (auto& [avatar, told] : shard.avatars) scratch_.push_back(told.replica.get());
  AvatarReplica::AdvanceAll(scratch_, tick_s_, evaluator_);
  if (message.more_steps > 0) return {};
  for (auto& [avatar, told] : shard.avatars) Show(message, avatar, told, screen);
  return {};
}

}  // namespace stridewire::client
