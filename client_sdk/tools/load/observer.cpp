#include "observer.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <glm/geometric.hpp>
#include <utility>

namespace stridewire::load {

Observer::Observer(ThreadContext& context, const boost::asio::ip::tcp::endpoint& server,
                   RunState& run, int index, LatencyProbes* probes)
    : Session(context, server, "load observer " + std::to_string(index)),
      run_(run),
      index_(index),
      probes_(probes) {
  const Layout& layout = run.layout;
  for (int world = 0; world < layout.worlds; ++world) {
    if (!run.options.observe_all && world != index % layout.worlds) continue;
    World& added = worlds_.emplace_back();
    added.index = world;
    added.seen.resize(layout.CountIn(world));
    avatar_count_ += added.seen.size();
  }
  if (index >= run.options.observers) {
    SelectAvatars(static_cast<std::size_t>(index - run.options.observers));
  }
}

// Selects avatars whose indices are evenly spaced. The first index is `which`, so observers select
// different avatars.
void Observer::SelectAvatars(std::size_t which) {
  const std::size_t all = avatar_count_;
  const std::size_t some = std::min(static_cast<std::size_t>(run_.options.partial_avatars), all);
  for (std::size_t i = 0; i < some; ++i) {
    std::size_t place = (which + i * all / some) % all;
    auto world = worlds_.begin();
    for (; place >= world->seen.size(); ++world) place -= world->seen.size();
    world->watched.push_back(run_.layout.Number(world->index, place));
  }
  std::erase_if(worlds_, [](const World& world) { return world.watched.empty(); });
  for (World& world : worlds_) {
    std::ranges::sort(world.watched);
    world.seen.assign(world.watched.size(), {});
  }
  avatar_count_ = some;
}

std::optional<std::size_t> Observer::IndexIn(const World& world, protocol::AvatarId number) const {
  // The id does not belong to an avatar of this run.
  if (!run_.layout.IsOurs(world.index, number)) return std::nullopt;
  if (world.watched.empty()) return run_.layout.IndexIn(number);
  const auto found = std::ranges::lower_bound(world.watched, number);
  if (found == world.watched.end() || *found != number) return std::nullopt;
  return static_cast<std::size_t>(found - world.watched.begin());
}

void Observer::OnWelcome() {
  run_.tick_hz = welcome().tick_hz;
  world_by_id_.clear();
  pending_joins_.clear();
  pending_observes_.clear();
  for (std::size_t i = 0; i < worlds_.size(); ++i) {
    const protocol::Seq seq = NextSeq();
    pending_joins_[seq] = i;
    Send(protocol::JoinWorld{
        .seq = seq, .name = WorldName(worlds_[i].index), .role = protocol::Role::kObserver});
  }
}

void Observer::OnMessage(protocol::Message& message, std::size_t frame_bytes, std::int64_t now_ns) {
  if (const auto* batch = std::get_if<protocol::PoseBatch>(&message)) {
    return OnBatch(*batch, frame_bytes, now_ns);
  }
  if (const auto* movements = std::get_if<protocol::Movements>(&message)) {
    return OnMovements(*movements, frame_bytes, now_ns);
  }
  if (const auto* info = std::get_if<protocol::WorldInfo>(&message)) return OnWorldInfo(*info);
  if (const auto* reply = std::get_if<protocol::Reply>(&message)) return OnReply(*reply);
  if (const auto* lagging = std::get_if<protocol::Lagging>(&message)) {
    const auto world = world_by_id_.find(lagging->world);
    if (world == world_by_id_.end()) return;
    std::uint64_t& reported = worlds_[world->second].batches_dropped;
    if (lagging->dropped_batches > reported)
      counts_.batches_dropped += lagging->dropped_batches - reported;
    reported = lagging->dropped_batches;
  }
}

void Observer::OnWorldInfo(const protocol::WorldInfo& info) {
  const auto pending = pending_joins_.find(info.seq);
  if (pending == pending_joins_.end())
    return Lose("the server sent WorldInfo of a world that was not joined");
  World& world = worlds_[pending->second];
  world.joint_count = info.skeleton.joints.size();
  // Evaluated poses are checked like full poses.
  const bool is_evaluated = run_.options.mode == protocol::PoseMode::kMovement;
  world.max_pose_bytes = protocol::PoseBytes(
      is_evaluated ? protocol::PoseMode::kFull : run_.options.mode, world.joint_count);
  if (is_evaluated) {
    if (info.library_hash != run_.library->hash()) {
      return run_.Problem(name() + ": --library differs from the library of world " + info.name);
    }
    world.replicas =
        std::make_unique<client::ReplicaSet>(run_.library, 1.0 / run_.tick_hz, world.seen.size());
  }
  world.codecs = {};
  if (protocol::IsCompact(SentMode())) {
    std::vector<std::int16_t> parents;
    for (const protocol::JointInfo& joint : info.skeleton.joints) parents.push_back(joint.parent);
    auto codecs =
        protocol::CompactCodecs::Make(info.rotation_quantizations, parents, info.reduced_joints);
    const protocol::CompactCodec* codec = codecs ? codecs->Find(SentMode()) : nullptr;
    if (codec == nullptr) return Lose("WorldInfo has no rotation quantizations");
    world.max_pose_bytes = std::max(world.max_pose_bytes, codec->pose_bytes());
    world.codecs = *std::move(codecs);
  }
  if (probes_ != nullptr) {
    world.last_poses.assign(world.seen.size() * world.max_pose_bytes, {});
    world.last_sizes.assign(world.seen.size(), 0);
  }
  rotations_.resize(std::max(rotations_.size(), world.joint_count));
  world_by_id_[info.world] = pending->second;
  const protocol::Seq seq = NextSeq();
  pending_observes_[seq] = pending->second;
  Send(protocol::Observe{.seq = seq,
                         .world = info.world,
                         .subscription = static_cast<protocol::SubscriptionId>(pending->second + 1),
                         .mode = run_.options.mode,
                         .avatars = world.watched,
                         .every_n_ticks = 1,
                         .with_events = false,
                         .detail = run_.options.detail});
}

protocol::PoseMode Observer::SentMode() const {
  return run_.options.mode == protocol::PoseMode::kQuantised
             ? protocol::CompactMode(run_.options.detail)
             : run_.options.mode;
}

void Observer::OnReply(const protocol::Reply& reply) {
  const bool joins = pending_joins_.erase(reply.seq) > 0;
  const bool observes = pending_observes_.erase(reply.seq) > 0;
  if (!joins && !observes) return Lose("the server sent an unexpected Reply");
  if (reply.code == protocol::StatusCode::kOk) return;
  run_.Problem(name() + ": the server refused to let it " + (joins ? "join" : "observe") + ": " +
               std::string(protocol::StatusCodeName(reply.code)) + " " + reply.text);
}

void Observer::OnLost(const std::string& why, bool by_us) {
  was_dropped_ = by_us;
  for (World& world : worlds_) {
    for (Seen& seen : world.seen) {
      const std::uint64_t last = seen.tick != 0 ? seen.tick : latest_tick_.load();
      seen = Seen{.away_since = seen.away_since == 0 && by_us ? last + 1 : seen.away_since};
    }
    world.first_tick = 0;
    // A restarted server counts its ticks from 0.
    for (Stream& stream : world.streams) stream.tick = 0;
    if (probes_ != nullptr && by_us) {
      for (std::size_t i = 0; i < world.seen.size(); ++i) {
        probes_->Abandon(run_.layout.Number(world.index, i) - 1);
      }
    }
    world.batches_dropped = 0;
  }
  seen_count_ = 0;
  sees_all_ = false;
  if (!by_us && !run_.is_ending) run_.Problem(name() + ": " + why);
}

namespace {

// Collects the poses of one Movements message in the layout of a batch.
class BatchSink final : public client::PoseSink {
 public:
  BatchSink(std::size_t joint_count, std::function<bool(protocol::AvatarId)> wants)
      : bytes_(protocol::PoseBytes(protocol::PoseMode::kFull, joint_count)),
        wants_(std::move(wants)) {}

  bool OnPose(protocol::AvatarId avatar, std::uint16_t, const client::PoseStamp& stamp,
              const AvatarReplica& replica) override {
    const ConstPoseSpan pose = replica.pose();
    const std::size_t begin = poses.size();
    poses.resize(begin + bytes_);
    const Status encoded = protocol::EncodePose(protocol::PoseMode::kFull, pose.root_position_m,
                                                pose.rotations, std::span(poses).subspan(begin));
    if (!encoded)
      std::fill(poses.begin() + static_cast<std::ptrdiff_t>(begin), poses.end(), std::byte{255});
    avatars.push_back(avatar);
    flags.push_back(
        static_cast<std::uint8_t>((stamp.discontinuity ? protocol::kPoseDiscontinuity : 0) |
                                  (stamp.standing ? protocol::kPoseStanding : 0)));
    return false;
  }
  void OnGone(protocol::AvatarId) override {}
  [[nodiscard]] bool Wants(protocol::AvatarId avatar) const override { return wants_(avatar); }

  std::vector<protocol::AvatarId> avatars;
  std::vector<std::uint8_t> flags;
  std::vector<std::byte> poses;

 private:
  std::size_t bytes_;
  std::function<bool(protocol::AvatarId)> wants_;
};

}  // namespace

void Observer::OnMovements(const protocol::Movements& movements, std::size_t frame_bytes,
                           std::int64_t now_ns) {
  const auto found = world_by_id_.find(movements.world);
  if (found == world_by_id_.end() || worlds_[found->second].replicas == nullptr) {
    return Lose("the server sent Movements of a world that is not observed");
  }
  World& world = worlds_[found->second];
  BatchSink sink(world.joint_count,
                 [&](protocol::AvatarId avatar) { return IndexIn(world, avatar).has_value(); });
  if (const Status taken = world.replicas->Apply(movements, sink); !taken) {
    return Invalid(world, movements.tick, Describe(taken.error()));
  }
  if (run_.window.Contains(movements.tick)) counts_.bytes_received += frame_bytes;
  const bool has_poses = movements.more_steps == 0 && movements.part + 1 == movements.parts;
  if (!has_poses) return;
  const protocol::PoseBatch batch{{.world = movements.world,
                                   .shard = movements.shard,
                                   .tick = movements.tick,
                                   .server_time_s = movements.server_time_s,
                                   .mode = protocol::PoseMode::kFull,
                                   .joint_count = static_cast<std::uint16_t>(world.joint_count)},
                                  sink.avatars,
                                  sink.flags,
                                  sink.poses};
  // States have the same tick as the changes before them.
  if (!movements.states && !AdvanceStream(world, batch)) return;
  TakePoses(world, batch, now_ns);
}

void Observer::OnBatch(const protocol::PoseBatch& batch, std::size_t frame_bytes,
                       std::int64_t now_ns) {
  const auto found = world_by_id_.find(batch.info.world);
  if (found == world_by_id_.end())
    return Lose("the server sent poses of a world that is not observed");
  World& world = worlds_[found->second];
  const std::uint64_t tick = batch.info.tick;
  if (batch.info.mode != SentMode() || batch.info.joint_count != world.joint_count) {
    return Invalid(world, tick, "a batch has an unexpected mode or number of joints");
  }
  if (!AdvanceStream(world, batch)) return;
  if (run_.window.Contains(tick)) counts_.bytes_received += frame_bytes;
  TakePoses(world, batch, now_ns);
}

void Observer::TakePoses(World& world, const protocol::PoseBatch& batch, std::int64_t now_ns) {
  const std::uint64_t tick = batch.info.tick;
  const bool counts = run_.window.Contains(tick);
  if (world.first_tick == 0) world.first_tick = tick;
  const bool verifies =
      batch_number_++ % static_cast<std::uint64_t>(run_.options.verify_one_in) == 0;
  protocol::PoseBatchReader reader(batch, world.codecs.Find(batch.info.mode));
  for (std::size_t i = 0; i < batch.avatars.size(); ++i) {
    const protocol::AvatarId number = batch.avatars[i];
    const std::span<const std::byte> pose = reader.Next();
    const std::optional<std::size_t> index = IndexIn(world, number);
    if (!index) continue;
    Seen& seen = world.seen[*index];
    if (seen.tick >= tick) {
      Invalid(world, tick,
              "avatar " + std::to_string(number) + " appeared twice in tick " +
                  std::to_string(tick) + ", or the tick is old");
      continue;
    }
    if (seen.tick == 0) ++seen_count_;
    counts_.poses_excused += ExcusedBefore(world, seen, tick);
    seen.away_since = 0;
    if (probes_ != nullptr) Measure(world, batch, i, pose, now_ns);
    if (verifies) (void)CheckPose(world, seen, batch, i, reader);
    seen.tick = tick;
    if (!counts) continue;
    ++counts_.poses_received;
    if ((batch.flags[i] & protocol::kPoseStanding) == 0) ++counts_.poses_moving;
  }
  UpdateProgress();
}

std::uint64_t Observer::ExcusedBefore(const World& world, const Seen& seen,
                                      std::uint64_t tick) const {
  if (seen.away_since == 0) return 0;
  std::uint64_t end = tick;
  if (world.first_tick != 0) {
    end = std::min(end, world.first_tick + static_cast<std::uint64_t>(kReconnectS * run_.tick_hz));
  }
  return run_.window.CountBetween(seen.away_since, end - 1);
}

bool Observer::AdvanceStream(World& world, const protocol::PoseBatch& batch) {
  const std::uint32_t key = std::uint32_t{batch.info.shard} << 16 | batch.info.part;
  auto stream = std::ranges::find(world.streams, key, &Stream::key);
  if (stream == world.streams.end()) {
    world.streams.push_back({.key = key});
    stream = world.streams.end() - 1;
  }
  const std::uint64_t tick = batch.info.tick;
  if (tick <= stream->tick) {
    Invalid(world, tick, "the tick of a batch does not increase");
    return false;
  }
  stream->tick = tick;
  stream->avatar_count = 0;
  for (const protocol::AvatarId number : batch.avatars) {
    if (IndexIn(world, number)) ++stream->avatar_count;
  }
  return true;
}

bool Observer::CheckPose(World& world, Seen& seen, const protocol::PoseBatch& batch, std::size_t i,
                         const protocol::PoseBatchReader& reader) {
  const std::uint64_t tick = batch.info.tick;
  Vec3 root_m(0.0f);
  const Status decoded = reader.Decode(root_m, std::span(rotations_).first(world.joint_count));
  if (!decoded) {
    Invalid(world, tick,
            "avatar " + std::to_string(batch.avatars[i]) + ": " + Describe(decoded.error()));
    return false;
  }
  const bool jumps = (batch.flags[i] & protocol::kPoseDiscontinuity) != 0;
  const Vec3 before_m = std::exchange(seen.root_m, root_m);
  const std::uint64_t before_tick = std::exchange(seen.root_tick, tick);
  if (before_tick == 0 || jumps) return true;
  const double elapsed_s = static_cast<double>(tick - before_tick) / run_.tick_hz;
  const double moved_m = glm::length(DVec3(root_m) - DVec3(before_m));
  if (moved_m <= kMaxSpeedMPerS * elapsed_s + kSpeedSlackM) return true;
  Invalid(world, tick,
          "avatar " + std::to_string(batch.avatars[i]) + " moved " + std::to_string(moved_m) +
              " m in " + std::to_string(elapsed_s) + " s without a discontinuity");
  return false;
}

void Observer::Measure(World& world, const protocol::PoseBatch& batch, std::size_t i,
                       std::span<const std::byte> pose, std::int64_t now_ns) {
  const protocol::AvatarId number = batch.avatars[i];
  const std::size_t index = run_.layout.IndexIn(number);
  // No valid pose is this large.
  if (pose.size() > world.max_pose_bytes) return;
  std::byte* const last = world.last_poses.data() + index * world.max_pose_bytes;
  const bool changed =
      world.last_sizes[index] != pose.size() || std::memcmp(last, pose.data(), pose.size()) != 0;
  const bool is_first = world.seen[index].tick == 0;
  if (changed) {
    std::memcpy(last, pose.data(), pose.size());
    world.last_sizes[index] = pose.size();
  }
  // A step cannot be measured if it was requested while this observer was dropped.
  if (is_first && was_dropped_) probes_->Abandon(number - 1);
  if (changed && !is_first) probes_->Pose(number - 1, batch.info.tick, now_ns, true);
}

void Observer::Invalid(const World& world, std::uint64_t tick, const std::string& what) {
  ++counts_.poses_invalid;
  run_.Problem(name() + ": " + WorldName(world.index) + " at tick " + std::to_string(tick) + ": " +
               what);
}

void Observer::UpdateProgress() {
  if (seen_count_ >= avatar_count_) sees_all_ = true;
  std::uint64_t newest = 0;
  bool saw_last = run_.window.is_set();
  for (const World& world : worlds_) {
    for (const Stream& stream : world.streams) {
      newest = std::max(newest, stream.tick);
      // A shard without observed avatars sends a single empty batch.
      saw_last = saw_last && (stream.tick >= run_.window.last() || stream.avatar_count == 0);
    }
  }
  latest_tick_ = newest;
  if (saw_last) saw_last_tick_ = true;
}

ObserverCounts Observer::Counts() const {
  ObserverCounts counts = counts_;
  for (const World& world : worlds_) {
    for (const Seen& seen : world.seen) {
      counts.poses_excused += ExcusedBefore(world, seen, run_.window.last() + 1);
    }
  }
  return counts;
}

}  // namespace stridewire::load
