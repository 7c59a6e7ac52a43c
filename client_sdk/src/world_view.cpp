#include "world_view.h"

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::client {

void WorldView::SetInfo(const protocol::WorldInfo& info) {
  if (has_info_ && !(skeleton_ == info.skeleton)) Clear();
  has_info_ = true;
  skeleton_ = info.skeleton;
  library_hash_ = info.library_hash;
  layers_ = info.layers;
  codecs_ = MakeCodecs(info);
  scratch_.assign(skeleton_.joints.size(), kIdentityQuat);
}

std::shared_ptr<const protocol::CompactCodecs> WorldView::MakeCodecs(
    const protocol::WorldInfo& info) {
  if (info.rotation_quantizations.empty()) return nullptr;
  std::vector<std::int16_t> parents;
  for (const protocol::JointInfo& joint : info.skeleton.joints) parents.push_back(joint.parent);
  // Make does not fail, because the decoder has checked the quantizations and parents.
  auto codecs =
      protocol::CompactCodecs::Make(info.rotation_quantizations, parents, info.reduced_joints);
  if (!codecs) return nullptr;
  return std::make_shared<const protocol::CompactCodecs>(*std::move(codecs));
}

void WorldView::ClearPoses() {
  EraseTracks([](const Track&) { return true; });
  shards_.clear();
  shard_ticks_.clear();
  updated_tick_ = 0;  // The ticks of another server may be lower.
  left_.clear();
  newest_time_s_ = -std::numeric_limits<double>::infinity();
}

void WorldView::Clear() {
  ClearPoses();
  has_info_ = false;
  skeleton_ = {};
  library_hash_.clear();
  layers_.clear();
  codecs_.reset();
  recording_.Clear();
}

void WorldView::SetFilter(std::optional<std::set<protocol::AvatarId>> filter) {
  filter_ = std::move(filter);
  if (!filter_) return;
  EraseTracks([this](const Track& track) { return !filter_->contains(track.avatar); });
}

template <typename Predicate>
void WorldView::EraseTracks(const Predicate& is_erased) {
  std::erase_if(tracks_, [&](const Track& track) {
    if (!is_erased(track)) return false;
    if (track.continued.movement != nullptr) ended_.push_back(track.avatar);
    const std::size_t bytes = PoseHistory::Bytes(pose_history_, track.history.joint_count());
    STRIDEWIRE_CHECK(budget_.used_bytes >= bytes);
    budget_.used_bytes -= bytes;
    if (track.gone) {
      --gone_count_;
    } else {
      ++revision_;
    }
    return true;
  });
}

Status WorldView::Apply(const protocol::PoseBatch& batch, std::uint64_t every_n_ticks,
                        Counts& counts) {
  const protocol::PoseBatchInfo& info = batch.info;
  const std::size_t joints = skeleton_.joints.size();
  if (info.joint_count != joints) {
    return Fail(ErrorCode::kShapeMismatch, "a batch has another number of joints than the skeleton",
                info.joint_count);
  }
  ++counts.batches;
  newest_time_s_ = std::max(newest_time_s_, info.server_time_s);

  const auto key = std::pair(info.shard, info.mode);
  if (!shards_.contains(key) && shards_.size() == kMaxShards) {
    return Fail(ErrorCode::kLimitExceeded, "poses come from too many shards", info.shard);
  }
  Shard& shard = shards_[key];
  if (shard.epoch != epoch_) {
    shard = Shard{info.tick, 0, epoch_, info.mode};
  } else if (info.tick > shard.tick) {
    // Batches of a region have gaps at ticks in which no pose is due.
    if (!info.is_partial && every_n_ticks > 0 && info.tick - shard.tick > every_n_ticks) {
      counts.missing += (info.tick - shard.tick - 1) / every_n_ticks;
    }
    shard.tick = info.tick;
    shard.parts_seen = 0;
  } else if (info.tick < shard.tick) {
    return Fail(ErrorCode::kMalformed, "the ticks of a shard decrease");
  }
  ++shard.parts_seen;

  protocol::PoseBatchReader reader(batch, codecs_ ? codecs_->Find(info.mode) : nullptr);
  for (std::size_t i = 0; i < batch.avatars.size(); ++i) {
    const protocol::AvatarId avatar = batch.avatars[i];
    reader.Next();
    if (filter_ && !filter_->contains(avatar)) continue;
    if (const auto left = left_.find(avatar); left != left_.end() && info.tick < left->second) {
      continue;
    }
    Vec3 root_position_m;
    if (Status status = reader.Decode(root_position_m, scratch_); !status) return status;
    Track* track = FindOrAddTrack(avatar);
    if (track == nullptr) {
      ++counts.refused;
      continue;
    }
    const PoseStamp stamp{.tick = info.tick,
                          .time_s = info.server_time_s,
                          .discontinuity = (batch.flags[i] & protocol::kPoseDiscontinuity) != 0,
                          .standing = (batch.flags[i] & protocol::kPoseStanding) != 0,
                          .detail = protocol::DetailOf(info.mode)};
    Push(*track, {info.shard, info.mode}, stamp, counts, [&](const PoseStamp& continued) {
      return track->history.Push(continued, root_position_m, scratch_);
    });
  }
  recording_.Add(batch, epoch_, codecs_);
  if (shard.parts_seen >= info.parts) MarkMissingAsGone(info);
  return {};
}

std::vector<WorldView::Track>::iterator WorldView::LowerBound(protocol::AvatarId avatar) {
  return std::ranges::lower_bound(tracks_, avatar, {}, &Track::avatar);
}

const WorldView::Track* WorldView::FindTrack(protocol::AvatarId avatar) const {
  const auto track = std::ranges::lower_bound(tracks_, avatar, {}, &Track::avatar);
  return track != tracks_.end() && track->avatar == avatar ? &*track : nullptr;
}

std::size_t WorldView::FindTrackAfter(std::size_t index, protocol::AvatarId avatar) const {
  // The search gives up after this many tracks. It may have to skip tracks of other shards.
  constexpr std::size_t kMaxSteps = 8;
  const std::size_t end = std::min(index + kMaxSteps, tracks_.size());
  while (index < end && tracks_[index].avatar < avatar) ++index;
  return index < end && tracks_[index].avatar == avatar ? index : tracks_.size();
}

void WorldView::Prefetch(protocol::AvatarId avatar) {
  std::size_t index = FindTrackAfter(prefetched_track_, avatar);
  if (index == tracks_.size()) {
    const auto track = LowerBound(avatar);
    if (track == tracks_.end() || track->avatar != avatar) return;
    index = static_cast<std::size_t>(track - tracks_.begin());
  }
  prefetched_track_ = index + 1;
  if (tracks_[index].continued.movement != nullptr) return;
  tracks_[index].history.PrefetchPush();
}

WorldView::Track* WorldView::FindOrAddTrack(protocol::AvatarId avatar) {
  // A message contains the avatars of one shard in ascending order, so the search continues after
  // the previous track, and otherwise falls back to a binary search.
  std::size_t index = FindTrackAfter(next_track_, avatar);
  if (index == tracks_.size()) {
    auto track = LowerBound(avatar);
    index = static_cast<std::size_t>(track - tracks_.begin());
    if (track == tracks_.end() || track->avatar != avatar) {
      const std::size_t joints = skeleton_.joints.size();
      const std::size_t bytes = PoseHistory::Bytes(pose_history_, joints);
      if (budget_.used_bytes + bytes > budget_.limit_bytes) return nullptr;
      budget_.used_bytes += bytes;
      STRIDEWIRE_CHECK(budget_.used_bytes <= budget_.limit_bytes);
      tracks_.insert(track, Track{.avatar = avatar, .history = {pose_history_, joints}});
      ++revision_;
    }
  }
  next_track_ = index + 1;
  return &tracks_[index];
}

template <typename PushPose>
void WorldView::Push(Track& track, const Lane& lane, PoseStamp stamp, Counts& counts,
                     const PushPose& push) {
  EndContinuing(track);
  stamp.discontinuity |= track.epoch != epoch_;
  if (stamp.discontinuity || track.history.IsInterrupted()) track.segment = ++last_segment_;
  stamp.segment = track.segment;
  if (push(stamp)) {
    ++counts.poses;
    track.epoch = epoch_;
    SetGone(track, false);
    // The tick of a pose can repeat if a second subscription contains the avatar.
  } else if (stamp.tick != track.seen_tick) {
    ++counts.refused;
  }
  track.shard = lane.first;
  track.mode = lane.second;
  track.seen_tick = stamp.tick;
}

bool WorldView::OnPose(protocol::AvatarId avatar, std::uint16_t shard, const PoseStamp& stamp,
                       const AvatarReplica& replica) {
  if (!Wants(avatar)) return false;
  Track* track = FindOrAddTrack(avatar);
  if (track == nullptr) {
    ++replica_counts_->refused;
    return false;
  }
  if (EvaluatesMovements()) AddTick();
  if (IsContinued(*track, stamp, replica)) {
    ++replica_counts_->poses;
  } else {
    PushEvaluated(*track, shard, stamp, replica);
    if (EvaluatesMovements()) BeginContinuing(*track);
  }
  if (recording_.enabled()) Record(*track, stamp, replica);
  return track->continued.movement != nullptr;
}

void WorldView::OnContinued(protocol::AvatarId avatar) {
  AddTick();
  ++replica_counts_->poses;
  if (recording_.enabled()) moving_.push_back(avatar);
}

void WorldView::PushEvaluated(Track& track, std::uint16_t shard, const PoseStamp& stamp,
                              const AvatarReplica& replica) {
  const bool is_movement = HasMovementOnly(replica);
  if (track.continued.movement != nullptr) {
    // The movement that continued has ended before the tick of this pose.
    const ShardTicks& ticks = *track.continued.ticks;
    const bool has_tick = &ticks == ticks_ && ticks.at(ticks.count - 1).tick == stamp.tick;
    // Flush evaluates `track.movement`, so it must precede the lines that replace this movement.
    Flush(track, ticks.count - (has_tick ? 1 : 0));
    track.continued = {};
  }
  if (stamp.discontinuity) track.movement = nullptr;
  if (is_movement && (recording_.enabled() || EvaluatesMovements())) KeepMovement(track, replica);
  Push(track, {shard, protocol::PoseMode::kMovement}, stamp, *replica_counts_,
       [&](const PoseStamp& continued) {
         if (is_movement && EvaluatesMovements()) {
           return track.history.Push(continued, track.movement, replica.movement_time_s(),
                                     *evaluator_);
         }
         const ConstPoseSpan pose = replica.pose();
         return track.history.Push(continued, pose.root_position_m, pose.rotations);
       });
}

void WorldView::Record(Track& track, const PoseStamp& stamp, const AvatarReplica& replica) {
  if (HasMovementOnly(replica)) {
    moving_.push_back(track.avatar);
    recording_.movements().Add(track.avatar, stamp, track.movement, replica.movement_time_s(),
                               replicas_->library(), tick_s_, track.recorded);
    return;
  }
  const ConstPoseSpan pose = replica.pose();
  evaluated_.push_back(track.avatar);
  evaluated_flags_.push_back(
      static_cast<std::uint8_t>((stamp.discontinuity ? protocol::kPoseDiscontinuity : 0) |
                                (stamp.standing ? protocol::kPoseStanding : 0)));
  if (!fits_) return;
  block_.Add(pose.root_position_m, pose.rotations);
  if (block_.size() == protocol::CompactCodec::kBlock) {
    EncodeBlock(*codecs_->Find(protocol::PoseMode::kCompact));
  }
}

bool WorldView::HasMovementOnly(const AvatarReplica& replica) {
  return replica.movement() != nullptr && !replica.has_layers();
}

void WorldView::ShardTicks::FindSample(double time_s) {
  sampled = count;
  while (sampled > oldest() && at(sampled - 1).time_s > time_s) --sampled;
  is_sampled = sampled > oldest();
  if (!is_sampled) return;
  const Tick& start = at(--sampled);
  share = 0.0;
  if (start.time_s == time_s) return;
  is_sampled = sampled + 1 < count;
  if (is_sampled) share = (time_s - start.time_s) / (at(sampled + 1).time_s - start.time_s);
}

void WorldView::AddTick() {
  if (ticks_ == nullptr) ticks_ = &shard_ticks_[message_->shard];
  if (ticks_->count > 0 && message_->tick <= ticks_->at(ticks_->count - 1).tick) return;
  ticks_->ring[ticks_->count++ % ticks_->ring.size()] = {message_->tick, message_->server_time_s,
                                                         message_->step};
}

bool WorldView::IsContinued(const Track& track, const PoseStamp& stamp,
                            const AvatarReplica& replica) const {
  const Continued& continued = track.continued;
  return continued.movement != nullptr && continued.ticks == ticks_ &&
         ticks_->at(ticks_->count - 1).tick == stamp.tick &&
         continued.number == replica.movement_number() && HasMovementOnly(replica) &&
         continued.standing == stamp.standing && !stamp.discontinuity && track.epoch == epoch_;
}

void WorldView::BeginContinuing(Track& track) {
  const PoseHistory& history = track.history;
  const auto [movement, movement_s] = history.NewestMovement();
  const PoseStamp& stamp = history.stamp(history.size() - 1);
  const MovementPoint newest = {ticks_->count - 1, message_->step, movement_s};
  if (movement == nullptr || movement != track.movement.get() || track.gone ||
      stamp.discontinuity || ticks_->at(newest.tick).tick != stamp.tick ||
      history.IsDisplayedAfterNewest() || history.IsCorrected(sampled_s_)) {
    return;
  }
  track.continued = {.movement = movement,
                     .ticks = ticks_,
                     .sampled = newest,
                     .stored = newest,
                     .similarity = EvaluationBatcher::SimilarityOf(movement->movement),
                     .number = movement->number,
                     .standing = stamp.standing};
}

void WorldView::MoveTo(std::uint64_t tick, const ShardTicks& ticks, MovementPoint& point) const {
  point.tick = tick;
  for (; point.step < ticks.at(tick).step; ++point.step) point.time_s += tick_s_;
}

std::optional<double> WorldView::SampledTime(Continued& continued) const {
  if (continued.movement == nullptr) return std::nullopt;
  const ShardTicks& ticks = *continued.ticks;
  if (!ticks.is_sampled || ticks.sampled < continued.sampled.tick) return std::nullopt;
  MoveTo(ticks.sampled, ticks, continued.sampled);
  const double time_s = continued.sampled.time_s;
  if (ticks.share == 0.0) return time_s;
  MovementPoint next = continued.sampled;
  MoveTo(ticks.sampled + 1, ticks, next);
  return time_s + ticks.share * (next.time_s - time_s);
}

void WorldView::PrepareHistory(Track& track, double time_s) {
  const Continued& continued = track.continued;
  if (continued.movement == nullptr) return;
  // Usually the next tick is late. The history then extrapolates the motion from all its poses.
  if (!continued.ticks->is_sampled) return EndContinuing(track);
  if (continued.ticks->sampled < continued.stored.tick && track.history.IsMovementAt(time_s))
    return;
  Flush(track);
}

void WorldView::Flush(Track& track, std::uint64_t end) {
  Continued& continued = track.continued;
  const ShardTicks& ticks = *continued.ticks;
  const std::uint64_t begin = std::max(continued.stored.tick + 1, ticks.oldest());
  for (std::uint64_t i = begin; i < end; ++i) {
    MoveTo(i, ticks, continued.stored);
    const ShardTicks::Tick& tick = ticks.at(i);
    // After a page was hidden, for example, the displayed poses are no longer stored. Push would
    // then forget them, so the segment has to change before.
    if (track.history.IsInterrupted()) track.segment = ++last_segment_;
    track.history.Push({.tick = tick.tick,
                        .time_s = tick.time_s,
                        .segment = track.segment,
                        .standing = continued.standing},
                       track.movement, continued.stored.time_s, *evaluator_);
    track.seen_tick = tick.tick;
  }
  if (continued.is_displayed) track.history.SetDisplayed(sampled_s_);
}

void WorldView::EndContinuing(Track& track) {
  if (track.continued.movement == nullptr) return;
  Flush(track);
  track.continued = {};
  ended_.push_back(track.avatar);
}

void WorldView::EndContinuingAll() {
  for (Track& track : tracks_) EndContinuing(track);
}

void WorldView::UpdateContinued(const protocol::Movements& movements) {
  // If the recording was cleared or the server has skipped ticks, the recording needs all movements
  // again.
  const auto shard = shard_ticks_.find(movements.shard);
  if (shard != shard_ticks_.end() && !movements.states && movements.more_steps == 0) {
    const ShardTicks::Tick& newest = shard->second.at(shard->second.count - 1);
    if (movements.tick - newest.tick != movements.step - newest.step) EndContinuingAll();
  }
  const std::uint64_t number = recording_.movements().number();
  if (std::exchange(recording_number_, number) != number) EndContinuingAll();

  // Each track is visited once in this number of ticks.
  constexpr std::uint64_t kTicks = 16;
  constexpr std::uint64_t kMaxAge = 64;
  static_assert(kMaxAge + kTicks < std::tuple_size_v<decltype(ShardTicks::ring)>);
  static_assert(2 * kTicks < MovementRecording::kMaxTicks);
  const std::uint64_t passed = movements.tick - std::min(updated_tick_, movements.tick);
  if (passed == 0) return;
  updated_tick_ = movements.tick;
  const auto share = static_cast<std::size_t>(std::min(passed, kTicks));
  const std::size_t count =
      std::min(tracks_.size(), tracks_.size() * share / std::size_t{kTicks} + 1);
  for (std::size_t i = 0; i < count; ++i) {
    if (updated_track_ >= tracks_.size()) updated_track_ = 0;
    Track& track = tracks_[updated_track_++];
    Continued& continued = track.continued;
    if (continued.movement == nullptr) continue;
    const ShardTicks& ticks = *continued.ticks;
    const bool is_recorded =
        !recording_.enabled() ||
        ticks.at(ticks.count - 1).tick - track.recorded.begin_tick + 2 * kTicks <
            MovementRecording::kMaxTicks;
    if (is_recorded && ticks.count - continued.stored.tick <= kMaxAge &&
        ticks.count - continued.sampled.tick <= kMaxAge) {
      continue;
    }
    Flush(track);
    if (ticks.count - continued.sampled.tick > kMaxAge) continued.sampled = continued.stored;
    if (is_recorded) continue;
    track.recorded = {};  // Without a cursor, Add stores the movement again.
    const PoseStamp& newest = track.history.stamp(track.history.size() - 1);
    recording_.movements().Add(track.avatar, newest, track.movement, continued.stored.time_s,
                               evaluator_->library(), tick_s_, track.recorded);
  }
}

void WorldView::KeepMovement(Track& track, const AvatarReplica& replica) {
  if (track.movement != nullptr && track.movement->number == replica.movement_number()) return;
  auto kept = std::make_shared<PlayedMovement>(*replica.movement(), replica.movement_number(),
                                               replica.previous_end_s());
  if (!kept->movement.is_inertial) kept->movement.difference_velocity = {};
  track.movement = std::move(kept);
}

void WorldView::EncodeBlock(const protocol::CompactCodec& codec) {
  const std::size_t bytes = codec.pose_bytes();
  const std::size_t first = encoded_.size();
  encoded_.resize(first + block_.size() * bytes);
  codec.Encode(block_);
  for (std::size_t i = 0; i < block_.size(); ++i) {
    fits_ &= block_.fits(i);
    block_.CopyBytes(i, std::span(encoded_).subspan(first + i * bytes, bytes));
  }
  block_.Clear();
}

void WorldView::RecordEvaluated(const protocol::Movements& movements) {
  if (evaluated_.empty() && moving_.empty()) return;
  const std::size_t joints = skeleton_.joints.size();
  protocol::PoseMode mode = protocol::PoseMode::kCompact;
  if (fits_ && block_.size() > 0) EncodeBlock(*codecs_->Find(mode));
  if (!fits_) {
    // A pose is outside the range of the compact mode, or the world has no such mode.
    mode = protocol::PoseMode::kQuantised;
    const std::size_t bytes = protocol::PoseBytes(mode, joints);
    encoded_.resize(evaluated_.size() * bytes);
    for (std::size_t i = 0; i < evaluated_.size(); ++i) {
      const PoseHistory& history = FindTrack(evaluated_[i])->history;
      const std::size_t newest = history.size() - 1;
      const auto out = std::span(encoded_).subspan(i * bytes, bytes);
      if (!protocol::EncodePose(mode, history.root_position_m(newest), history.rotations(newest),
                                out)) {
        return;
      }
    }
  }
  recording_.Add({.info = {.world = movements.world,
                           .shard = movements.shard,
                           .part = recorded_part_++,
                           .tick = movements.tick,
                           .server_time_s = movements.server_time_s,
                           .mode = mode,
                           .joint_count = static_cast<std::uint16_t>(joints)},
                  .avatars = evaluated_,
                  .flags = evaluated_flags_,
                  .poses = encoded_},
                 epoch_, codecs_, moving_);
}

Status WorldView::Apply(const protocol::Movements& movements, ReplicaSet& replicas,
                        std::uint64_t every_n_ticks, Counts& counts) {
  if (replicas.library()->skeleton().joints.size() != skeleton_.joints.size()) {
    return Fail(ErrorCode::kShapeMismatch,
                "the library has another number of joints than the skeleton");
  }
  if (evaluator_ == nullptr || evaluator_->library() != replicas.library() ||
      tick_s_ != replicas.tick_s()) {
    EndContinuingAll();
    for (Track& track : tracks_) track.history.EvaluateAll();
    tick_s_ = replicas.tick_s();
    evaluator_ = std::make_unique<MovementEvaluator>(replicas.library());
  }
  ++counts.batches;
  newest_time_s_ = std::max(newest_time_s_, movements.server_time_s);
  replica_every_n_ticks_ = std::max<std::uint64_t>(every_n_ticks, 1);
  replica_counts_ = &counts;
  replicas_ = &replicas;
  message_ = &movements;
  ticks_ = nullptr;
  if (EvaluatesMovements()) UpdateContinued(movements);
  moving_.clear();
  evaluated_.clear();
  evaluated_flags_.clear();
  encoded_.clear();
  block_.Clear();
  fits_ = codecs_ != nullptr && codecs_->Find(protocol::PoseMode::kCompact) != nullptr;
  const Status status = replicas.Apply(movements, *this);
  RecordEvaluated(movements);
  EraseGone(movements.server_time_s);
  return status;
}

void WorldView::EraseGone(double time_s) {
  if (gone_count_ == 0) return;
  EraseTracks([time_s](const Track& t) {
    return t.gone && t.history.size() > 0 &&
           time_s - t.history.stamp(t.history.size() - 1).time_s > kKeepGoneS;
  });
}

void WorldView::MarkMissingAsGone(const protocol::PoseBatchInfo& info) {
  if (info.is_partial) {
    std::erase_if(left_,
                  [&](const auto& item) { return item.second + kKeepLeftTicks < info.tick; });
    return EraseGone(info.server_time_s);
  }
  for (Track& t : tracks_) {
    if (t.shard == info.shard && t.mode == info.mode && t.seen_tick < info.tick) SetGone(t, true);
  }
  EraseGone(info.server_time_s);
}

void WorldView::Leave(protocol::AvatarId avatar, std::uint64_t tick) {
  Remove(avatar);
  if (left_.contains(avatar) || left_.size() < protocol::kMaxItems) left_[avatar] = tick;
}

void WorldView::Remove(protocol::AvatarId avatar) {
  const auto track = LowerBound(avatar);
  if (track != tracks_.end() && track->avatar == avatar) SetGone(*track, true);
}

void WorldView::SetGone(Track& track, bool gone) {
  if (track.gone == gone) return;
  EndContinuing(track);
  track.gone = gone;
  if (gone) {
    ++gone_count_;
  } else {
    --gone_count_;
  }
  ++revision_;
}

void WorldView::SampleAll(double time_s, CrowdPose& out, DisplayCounts& displayed) {
  const std::size_t joints = skeleton_.joints.size();
  out.Resize(tracks_.size(), joints);
  const auto rotations_of = [&](std::size_t pose) {
    return std::span(out.rotations).subspan(pose * joints, joints);
  };
  const auto is_after_newest = [time_s](const PoseHistory& history) {
    return time_s > history.stamp(history.size() - 1).time_s;
  };
  for (auto& [shard, ticks] : shard_ticks_) ticks.FindSample(time_s);
  sampled_tracks_.clear();
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    const std::size_t pose = sampled_tracks_.size();
    Track& track = tracks_[i];
    if (const auto movement_s = SampledTime(track.continued)) {
      track.continued.is_displayed = true;
      evaluator_->Add(track.continued.movement->movement, track.continued.similarity, *movement_s,
                      out.roots_m[pose], rotations_of(pose));
      sampled_tracks_.push_back({i, true});
      continue;
    }
    PrepareHistory(track, time_s);
    PoseHistory& history = track.history;
    if (history.size() == 0 || (track.gone && is_after_newest(history))) continue;
    if (history.Prepare(time_s, out.roots_m[pose], rotations_of(pose))) {
      sampled_tracks_.push_back({i, false});
    }
  }
  if (evaluator_ != nullptr) evaluator_->Evaluate();
  std::size_t count = 0;
  for (const auto& [i, is_continued] : sampled_tracks_) {
    Track& track = tracks_[i];
    out.avatars[count] = track.avatar;
    if (is_continued) {
      displayed.Add({.interpolated = true}, false);
      out.flags[count++] = track.continued.standing ? kCrowdStanding : 0;
      continue;
    }
    if (count + 1 < sampled_tracks_.size()) {
      const auto& [next, is_next_continued] = sampled_tracks_[count + 1];
      if (!is_next_continued) tracks_[next].history.Prefetch(time_s, true);
    }
    PoseHistory& history = track.history;
    const auto sampled = history.Display(time_s, out.roots_m[count], rotations_of(count));
    STRIDEWIRE_CHECK(sampled.has_value());
    displayed.Add(*sampled, is_after_newest(history));
    const PoseStamp& stamp = history.stamp(sampled->index);
    int flags = CrowdFlagsOf(stamp);
    if (sampled->extrapolated) {
      flags |= kCrowdExtrapolated;
    } else if (!sampled->interpolated) {
      flags |= kCrowdHeld;
    }
    out.flags[count++] = static_cast<std::uint8_t>(flags);
  }
  sampled_s_ = time_s;
  out.Resize(count, joints);
}

void WorldView::RenumberSegments() {
  for (Track& track : tracks_) {
    Flush(track);
    PoseHistory& history = track.history;
    std::optional<std::uint32_t> old;
    for (std::size_t i = 0; i < history.size(); ++i) {
      const std::uint32_t segment = history.stamp(i).segment;
      if (old != segment) track.segment = ++last_segment_;
      old = segment;
      history.SetSegment(i, track.segment);
    }
  }
}

PoseHistory* WorldView::Find(protocol::AvatarId avatar) {
  const auto track = LowerBound(avatar);
  if (track == tracks_.end() || track->avatar != avatar) return nullptr;
  Flush(*track);
  return &track->history;
}

bool WorldView::IsGone(protocol::AvatarId avatar) const {
  const Track* track = FindTrack(avatar);
  return track == nullptr || track->gone;
}

std::vector<protocol::AvatarId> WorldView::Avatars() const {
  std::vector<protocol::AvatarId> avatars;
  for (const Track& track : tracks_) {
    if (!track.gone) avatars.push_back(track.avatar);
  }
  return avatars;
}

}  // namespace stridewire::client
