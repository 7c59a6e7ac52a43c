#include "pose_recording.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/check.h"
#include "pose_history.h"
#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::client {

bool PoseRecording::Decoded::Find(protocol::AvatarId avatar, std::size_t& index) const {
  const auto found = std::ranges::lower_bound(poses.avatars, avatar);
  if (found == poses.avatars.end() || *found != avatar) return false;
  index = static_cast<std::size_t>(found - poses.avatars.begin());
  return true;
}

ConstPoseSpan PoseRecording::Decoded::pose(std::size_t i) const {
  return {poses.roots_m[i],
          std::span(poses.rotations).subspan(i * poses.joint_count, poses.joint_count)};
}

void PoseRecording::Add(const protocol::PoseBatch& batch, std::uint64_t epoch,
                        const std::shared_ptr<const protocol::CompactCodecs>& codecs,
                        std::span<const protocol::AvatarId> moving) {
  if (!enabled()) return;
  const protocol::PoseBatchInfo& info = batch.info;
  // Streams of regions have negative keys, one per mode and shard.
  constexpr std::int32_t kModes = 8;
  const std::int32_t key = info.is_partial
                               ? -1 - (kModes * info.shard + static_cast<std::int32_t>(info.mode))
                               : info.shard;
  Stream& stream = streams_[key];
  Tick* last = stream.ticks.empty() ? nullptr : &stream.ticks.back();
  if (last != nullptr && last->info.tick == info.tick) {
    if (last->info.mode != info.mode ||
        std::ranges::any_of(last->parts, [&](const Part& p) { return p.number == info.part; })) {
      return;
    }
    Discard(stream, *last);
  } else if (last == nullptr ||
             (last->info.tick < info.tick && last->info.server_time_s < info.server_time_s)) {
    last = &stream.ticks.emplace_back(Tick{info, epoch, codecs, {}, 0});
  } else {
    return;
  }
  last->parts.push_back(Part{info.part,
                             {batch.avatars.begin(), batch.avatars.end()},
                             {batch.flags.begin(), batch.flags.end()},
                             {batch.poses.begin(), batch.poses.end()},
                             {moving.begin(), moving.end()}});
  const std::size_t bytes = sizeof(Tick) + sizeof(Part) + batch.avatars.size_bytes() +
                            batch.flags.size() + batch.poses.size() + moving.size_bytes();
  last->bytes += bytes;
  bytes_ += bytes;
  last_time_s_ = std::fmax(last_time_s_, info.server_time_s);  // Ignores NaN.
  DropOld();
}

void PoseRecording::Clear() {
  streams_.clear();
  movements_.Clear();
  bytes_ = 0;
  last_time_s_ = std::numeric_limits<double>::quiet_NaN();
}

double PoseRecording::first_time_s() const {
  double first_s = std::numeric_limits<double>::quiet_NaN();
  for (const auto& [key, stream] : streams_) {
    first_s = std::fmin(first_s, stream.ticks.front().info.server_time_s);
  }
  return first_s;
}

void PoseRecording::Discard(Stream& stream, const Tick& tick) {
  for (const auto& decoded : stream.decoded) {
    if (decoded->source == &tick) decoded->source = nullptr;
  }
}

void PoseRecording::DropOld() {
  for (;;) {
    auto oldest = streams_.end();
    for (auto it = streams_.begin(); it != streams_.end(); ++it) {
      STRIDEWIRE_CHECK(!it->second.ticks.empty());
      if (oldest == streams_.end() || it->second.ticks.front().info.server_time_s <
                                          oldest->second.ticks.front().info.server_time_s) {
        oldest = it;
      }
    }
    if (oldest == streams_.end()) return movements_.Clear();
    auto& [key, stream] = *oldest;
    const Tick& tick = stream.ticks.front();
    if (tick.info.server_time_s >= last_time_s_ - length_s_ && bytes() <= max_bytes_) {
      return movements_.DropBefore(tick.info.tick);
    }
    Discard(stream, tick);
    bytes_ -= tick.bytes;
    stream.ticks.pop_front();
    // This also frees the decoded poses of the stream.
    if (stream.ticks.empty()) streams_.erase(oldest);
  }
}

std::size_t PoseRecording::DecodedBytes() const {
  std::size_t bytes = 0;
  for (const auto& [key, stream] : streams_) {
    for (const auto& decoded : stream.decoded) {
      const CrowdPose& poses = decoded->poses;
      bytes += sizeof(Decoded) + poses.avatars.capacity() * sizeof(protocol::AvatarId) +
               poses.flags.capacity() + poses.roots_m.capacity() * sizeof(Vec3) +
               poses.rotations.capacity() * sizeof(Quat);
    }
  }
  return bytes;
}

const PoseRecording::Decoded* PoseRecording::Decode(Stream& stream, const Tick& tick) {
  Decoded* into = nullptr;
  for (const auto& decoded : stream.decoded) {
    if (decoded->source == &tick) {
      decoded->last_use = ++use_count_;
      return decoded.get();
    }
    if (into == nullptr || decoded->last_use < into->last_use) into = decoded.get();
  }
  if (stream.decoded.size() < kMaxDecoded) {
    into = stream.decoded.emplace_back(std::make_unique<Decoded>()).get();
  }
  const std::size_t joints = tick.info.joint_count;
  std::size_t count = 0;
  for (const Part& part : tick.parts) count += part.avatars.size() + part.moving.size();
  unsorted_.Resize(count, joints);
  std::size_t index = 0;
  for (const Part& part : tick.parts) {
    const protocol::PoseBatch batch{tick.info, part.avatars, part.flags, part.poses};
    protocol::PoseBatchReader reader(batch,
                                     tick.codecs ? tick.codecs->Find(tick.info.mode) : nullptr);
    for (std::size_t i = 0; i < part.avatars.size(); ++i) {
      reader.Next();
      // WorldView decodes only the poses of observed avatars, so others may be invalid.
      const auto rotations = std::span(unsorted_.rotations).subspan(index * joints, joints);
      if (!reader.Decode(unsorted_.roots_m[index], rotations)) continue;
      unsorted_.avatars[index] = part.avatars[i];
      unsorted_.flags[index++] = CrowdFlagsOf(
          PoseStamp{.discontinuity = (part.flags[i] & protocol::kPoseDiscontinuity) != 0,
                    .standing = (part.flags[i] & protocol::kPoseStanding) != 0,
                    .detail = protocol::DetailOf(tick.info.mode)});
    }
    index += movements_.Evaluate(tick.info.tick, part.moving, unsorted_, index);
  }
  order_.resize(index);
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  if (!std::is_sorted(unsorted_.avatars.begin(),
                      unsorted_.avatars.begin() + static_cast<std::ptrdiff_t>(index))) {
    std::ranges::sort(order_, {}, [&](std::size_t i) { return unsorted_.avatars[i]; });
  }
  CrowdPose& poses = into->poses;
  poses.Resize(index, joints);
  for (std::size_t i = 0; i < index; ++i) {
    const std::size_t from = order_[i];
    poses.avatars[i] = unsorted_.avatars[from];
    poses.flags[i] = unsorted_.flags[from];
    poses.roots_m[i] = unsorted_.roots_m[from];
    std::ranges::copy(std::span(unsorted_.rotations).subspan(from * joints, joints),
                      poses.rotations.begin() + static_cast<std::ptrdiff_t>(i * joints));
  }
  into->source = &tick;
  into->last_use = ++use_count_;
  return into;
}

PoseRecording::Neighbours PoseRecording::FindNeighbours(Stream& stream, double time_s) {
  const auto& ticks = stream.ticks;
  const auto after = static_cast<std::size_t>(
      std::ranges::upper_bound(ticks, time_s, {},
                               [](const Tick& tick) { return tick.info.server_time_s; }) -
      ticks.begin());
  if (after == 0) return {};
  const Tick& start = ticks[after - 1];
  if (after == ticks.size() && time_s - start.info.server_time_s > kKeepS) return {};
  const auto continues = [](const Tick& from, const Tick& to) {
    return from.epoch == to.epoch && from.info.joint_count == to.info.joint_count;
  };
  Neighbours around;
  around.start = Decode(stream, start);
  around.exact = start.info.server_time_s == time_s;
  if (around.exact || after == ticks.size() || !continues(start, ticks[after])) return around;
  const Tick& end = ticks[after];
  around.end = Decode(stream, end);
  if (after >= 2 && continues(ticks[after - 2], start)) {
    around.before = Decode(stream, ticks[after - 2]);
  }
  if (after + 1 < ticks.size() && continues(end, ticks[after + 1])) {
    around.beyond = Decode(stream, ticks[after + 1]);
  }
  return around;
}

void PoseRecording::Interpolate(const Neighbours& around, double time_s, CrowdPose& out) {
  const CrowdPose& start = around.start->poses;
  const std::size_t joints = out.joint_count;
  if (start.joint_count != joints) return;
  const auto time_of = [](const Decoded* tick) { return tick->source->info.server_time_s; };
  // Finds the pose of the avatar in `tick`. Returns true if there is one and it continues the
  // previous pose of the avatar.
  const auto find = [](const Decoded* tick, protocol::AvatarId avatar, std::size_t& index) {
    return tick != nullptr && tick->Find(avatar, index) &&
           (tick->poses.flags[index] & kCrowdDiscontinuity) == 0;
  };
  for (std::size_t i = 0; i < start.avatars.size(); ++i) {
    const protocol::AvatarId avatar = start.avatars[i];
    const auto place = std::ranges::lower_bound(out.avatars, avatar);
    if (place == out.avatars.end() || *place != avatar) continue;
    const auto o = static_cast<std::size_t>(place - out.avatars.begin());
    const auto rotations = std::span(out.rotations).subspan(o * joints, joints);
    std::size_t end = 0;
    if (!find(around.end, avatar, end)) {
      out.roots_m[o] = start.roots_m[i];
      std::ranges::copy(around.start->pose(i).rotations, rotations.begin());
      out.flags[o] =
          around.exact ? start.flags[i] : static_cast<std::uint8_t>(start.flags[i] | kCrowdHeld);
      continue;
    }
    std::size_t before = 0;
    const bool has_before = (start.flags[i] & kCrowdDiscontinuity) == 0 &&
                            around.before != nullptr && around.before->Find(avatar, before);
    std::size_t beyond = 0;
    const bool has_beyond = find(around.beyond, avatar, beyond);
    const Decoded* first = has_before ? around.before : around.start;
    const Decoded* last = has_beyond ? around.beyond : around.end;
    InterpolatePose(
        {.times_s = {time_of(first), time_of(around.start), time_of(around.end), time_of(last)},
         .before = first->pose(has_before ? before : i),
         .start = around.start->pose(i),
         .end = around.end->pose(end),
         .beyond = last->pose(has_beyond ? beyond : end)},
        time_s, out.roots_m[o], rotations);
    out.flags[o] = start.flags[i];
  }
}

void PoseRecording::SampleAll(double time_s, const std::function<bool(protocol::AvatarId)>& wants,
                              CrowdPose& out) {
  around_.clear();
  out.Resize(0, 0);
  for (auto& [key, stream] : streams_) {
    const Neighbours around = FindNeighbours(stream, time_s);
    if (around.start == nullptr) continue;
    around_.push_back(around);
    out.joint_count = around.start->poses.joint_count;
    for (const protocol::AvatarId avatar : around.start->poses.avatars) {
      if (wants(avatar)) out.avatars.push_back(avatar);
    }
  }
  std::ranges::sort(out.avatars);
  const auto repeated = std::ranges::unique(out.avatars);
  out.avatars.erase(repeated.begin(), repeated.end());
  out.Resize(out.avatars.size(), out.joint_count);
  // If an avatar has moved to another ring of a region, two streams contain it. The pose of the
  // later tick is used, because it is written last.
  std::ranges::sort(around_, {}, [](const Neighbours& n) { return n.start->source->info.tick; });
  for (const Neighbours& around : around_) Interpolate(around, time_s, out);
  if (DecodedBytes() > max_bytes_ / 2) {
    for (auto& [key, stream] : streams_) stream.decoded.clear();
  }
  DropOld();
}

}  // namespace stridewire::client
