#include "movement_recording.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/check.h"

namespace stridewire::client {

void MovementRecording::Add(protocol::AvatarId avatar, const PoseStamp& stamp,
                            const std::shared_ptr<const PlayedMovement>& movement, double time_s,
                            const std::shared_ptr<const MotionLibrary>& library, double tick_s,
                            Cursor& cursor) {
  if (library_ != library) {
    Clear();
    library_ = library;
  }
  // If the server has skipped ticks, the time differs from the expected one by more than this.
  constexpr double kMaxDifferenceS = 1e-6;
  const std::uint64_t ticks = stamp.tick - cursor.begin_tick;
  if (cursor.recording == number_ && cursor.movement == movement->number &&
      cursor.standing == stamp.standing && !stamp.discontinuity && ticks < kMaxTicks &&
      std::fabs(cursor.begin_s + static_cast<double>(ticks) * tick_s - time_s) < kMaxDifferenceS) {
    return;
  }
  const Movement& of = movement->movement;
  const std::size_t bytes = sizeof(Span) + sizeof(PlayedMovement) +
                            of.weights.size() * sizeof(float) +
                            of.difference.rotations.size() * sizeof(Quat) +
                            of.difference_velocity.joints_rad_s.size() * sizeof(Vec3);
  spans_.push_back({.avatar = avatar,
                    .flags = CrowdFlagsOf(stamp),
                    .begin_tick = stamp.tick,
                    .begin_s = time_s,
                    .tick_s = tick_s,
                    .movement = movement,
                    .bytes = bytes});
  bytes_ += bytes;
  cursor = {.recording = number_,
            .movement = movement->number,
            .standing = stamp.standing,
            .begin_tick = stamp.tick,
            .begin_s = time_s};
}

std::size_t MovementRecording::Evaluate(std::uint64_t tick,
                                        std::span<const protocol::AvatarId> avatars, CrowdPose& out,
                                        std::size_t at) {
  if (spans_.empty()) return 0;
  // Finds, for each avatar, the newest movement that begins at or before the tick.
  found_.assign(avatars.size(), nullptr);
  for (auto span = spans_.rbegin(); span != spans_.rend(); ++span) {
    if (span->begin_tick > tick) continue;
    // Twice the maximum, because spans of different shards may be out of order.
    if (tick - span->begin_tick > 2 * kMaxTicks) break;
    const auto place = std::ranges::lower_bound(avatars, span->avatar);
    if (place == avatars.end() || *place != span->avatar) continue;
    const Span*& found = found_[static_cast<std::size_t>(place - avatars.begin())];
    if (found == nullptr) found = &*span;
  }
  if (!evaluator_) evaluator_.emplace(library_);
  std::size_t count = 0;
  for (const Span* span : found_) {
    if (span == nullptr) continue;
    const std::uint64_t ticks = tick - span->begin_tick;
    const double time_s = span->begin_s + static_cast<double>(ticks) * span->tick_s;
    const std::size_t index = at + count++;
    evaluator_->Add(span->movement->movement, time_s, out.roots_m[index],
                    std::span(out.rotations).subspan(index * out.joint_count, out.joint_count));
    out.avatars[index] = span->avatar;
    // Only the first pose may be a discontinuity.
    out.flags[index] =
        ticks == 0 ? span->flags : static_cast<std::uint8_t>(span->flags & ~kCrowdDiscontinuity);
  }
  evaluator_->Evaluate();
  return count;
}

void MovementRecording::DropBefore(std::uint64_t tick) {
  while (!spans_.empty() && spans_.front().begin_tick + kMaxTicks <= tick) {
    bytes_ -= spans_.front().bytes;
    spans_.pop_front();
  }
}

void MovementRecording::Clear() {
  spans_.clear();
  bytes_ = 0;
  evaluator_.reset();
  library_.reset();
  ++number_;
}

}  // namespace stridewire::client
