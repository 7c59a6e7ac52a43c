#include "session_state.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace stridewire::client {

namespace {

/// Copies as many whole UTF-8 characters as fit, and a terminating 0.
void CopyText(std::string_view text, char* out, std::size_t out_bytes) {
  std::size_t length = std::min(text.size(), out_bytes - 1);
  if (length < text.size()) {
    while (length > 0 && (static_cast<unsigned char>(text[length]) & 0xC0) == 0x80) --length;
  }
  if (length > 0) std::memcpy(out, text.data(), length);  // An empty text may have a null pointer.
  out[length] = '\0';
}

}  // namespace

SessionState::SessionState(const SessionOptions& options)
    : options_(options),
      backoff_(options.seed),
      events_(options.max_events),
      libraries_(options.library_folder) {
  pose_budget_.limit_bytes = options.max_pose_bytes;
}

std::size_t TerrainBytes(const std::optional<protocol::TerrainInfo>& terrain) {
  if (!terrain) return 0;
  std::size_t bytes = terrain->boxes.size() * sizeof(protocol::TerrainBoxInfo);
  if (terrain->height_field) bytes += terrain->height_field->heights_m.size() * sizeof(float);
  return bytes;
}

stridewire_status SessionState::Refuse(stridewire_status status, std::string_view text) {
  last_status_ = status;
  last_text_ = text;
  return status;
}

bool SessionState::IsOpen() const {
  return state_ == State::kWaiting || state_ == State::kConnecting || state_ == State::kGreeting ||
         state_ == State::kReady;
}

const WorldView* SessionState::FindWorld(stridewire_world world) const {
  const auto found = worlds_.find(world);
  return found == worlds_.end() ? nullptr : found->second.view.get();
}

WorldView* SessionState::FindWorld(stridewire_world world) {
  const auto found = worlds_.find(world);
  return found == worlds_.end() ? nullptr : found->second.view.get();
}

std::optional<SessionState::WorldState> SessionState::FindWorldState(stridewire_world world) const {
  const auto found = worlds_.find(world);
  if (found == worlds_.end()) return std::nullopt;
  return found->second.state;
}

stridewire_world SessionState::FindHandle(protocol::WorldId id) const {
  for (const auto& [handle, world] : worlds_) {
    if (world.server_id == id) return handle;
  }
  return 0;
}

SessionState::World* SessionState::FindByServerId(protocol::WorldId id, stridewire_world& handle) {
  for (auto& [number, world] : worlds_) {
    if (world.server_id == id) {
      handle = number;
      return &world;
    }
  }
  return nullptr;
}

void SessionState::UpdateFilter(World& world) {
  std::set<protocol::AvatarId> wanted;
  for (const auto& [id, subscription] : world.subscriptions) {
    const auto& avatars = subscription.message.avatars;
    if (avatars.empty()) return world.view->SetFilter(std::nullopt);
    wanted.insert(avatars.begin(), avatars.end());
  }
  if (wanted.empty()) return world.view->SetFilter(std::nullopt);
  world.view->SetFilter(std::move(wanted));
}

std::uint64_t SessionState::EveryNTicks(const World& world, protocol::PoseMode mode) {
  const protocol::PoseDetail detail = protocol::DetailOf(mode);
  // Compact poses belong to subscriptions of kQuantised.
  if (protocol::IsCompact(mode)) mode = protocol::PoseMode::kQuantised;
  std::uint64_t every = 0;
  const auto add = [&](protocol::PoseDetail of, std::uint64_t n) {
    if (of == detail) every = every == 0 ? n : std::min(every, n);
  };
  for (const auto& [id, subscription] : world.subscriptions) {
    const protocol::Observe& observe = subscription.message;
    if (observe.mode != mode) continue;
    add(observe.detail, observe.every_n_ticks);
    if (!observe.region) continue;
    for (std::size_t i = 0; i < observe.region->ring_details.size(); ++i) {
      add(observe.region->ring_details[i], observe.region->rings[i].every_n_ticks);
    }
  }
  return every;
}

double SessionState::PoseIntervalS() const {
  // Longer intervals between the poses of an avatar do not increase the delay of all avatars. Such
  // an avatar is extrapolated instead.
  constexpr double kMaxIntervalS = 0.25;
  std::uint64_t every = 1;
  for (const auto& [handle, world] : worlds_) {
    for (const auto& [id, subscription] : world.subscriptions) {
      const protocol::Observe& observe = subscription.message;
      every = std::max<std::uint64_t>(every, observe.every_n_ticks);
      if (!observe.region) continue;
      for (const auto& ring : observe.region->rings) {
        every = std::max<std::uint64_t>(every, ring.every_n_ticks);
      }
    }
  }
  return std::min(static_cast<double>(every) / tick_hz_, kMaxIntervalS);
}

double SessionState::RenderTime(double local_s) const {
  if (options_.render_delay_s >= 0.0) return clock_.ServerTime(local_s) - options_.render_delay_s;
  if (playout_.ready()) return playout_.DisplayTime(local_s);
  return clock_.ServerTime(local_s) - PlayoutClock::kFirstDelayS;
}

stridewire_playout SessionState::Playout(double local_s) const {
  stridewire_playout p{};
  p.displayed_poses = displayed_.poses;
  p.extrapolated_poses = displayed_.extrapolated;
  p.held_poses = displayed_.held;
  p.jumps = playout_jumps_;
  p.jitter_s = jitter_s_;
  p.worst_jitter_s = worst_jitter_s_;
  if (!clock_.ready()) return p;
  const double server_s = clock_.ServerTime(local_s);
  p.delay_s = p.target_delay_s = server_s - RenderTime(local_s);
  if (options_.render_delay_s < 0.0 && playout_.ready()) {
    p.target_delay_s += playout_.MissingDelay(local_s);
  }
  double newest_s = -std::numeric_limits<double>::infinity();
  for (const auto& [handle, world] : worlds_) {
    newest_s = std::max(newest_s, world.view->newest_time_s());
  }
  if (std::isfinite(newest_s)) {
    p.interval_s = PoseIntervalS();
    p.newest_age_s = std::max(0.0, server_s - newest_s);
  }
  return p;
}

stridewire_statistics SessionState::Statistics() const {
  stridewire_statistics s{};
  s.bytes_received = bytes_received_;
  s.bytes_sent = bytes_sent_;
  s.batches_received = counts_.batches;
  s.poses_received = counts_.poses;
  s.poses_refused = counts_.refused;
  s.batches_missing = counts_.missing;
  s.dropped_batches = dropped_batches_;
  s.events_received = events_received_;
  s.events_dropped = events_.dropped();
  s.commands_sent = commands_sent_;
  s.commands_resent = commands_resent_;
  s.commands_waiting = command_count_;
  s.connects = connects_;
  s.resumes = resumes_;
  s.connect_failures = connect_failures_;
  s.buffered_bytes = pose_budget_.used_bytes + events_.size() * sizeof(stridewire_event) +
                     command_bytes_ + output_.capacity() +
                     (reader_ ? reader_->capacity_bytes() : 0);
  for (const auto& [handle, world] : worlds_) s.buffered_bytes += TerrainBytes(world.terrain);
  if (!rtts_s_.empty()) s.rtt_s = *std::ranges::min_element(rtts_s_);
  return s;
}

stridewire_event SessionState::MakeEvent(stridewire_event_type type, stridewire_world world,
                                         stridewire_status status, std::string_view text) const {
  stridewire_event event{};
  event.type = type;
  event.world = world;
  event.status = status;
  event.group = -1;
  CopyText(text, event.text, sizeof event.text);
  return event;
}

void SessionState::EndInspection(std::uint64_t nonce, stridewire_status status,
                                 std::string_view text) {
  if (inspections_.erase(nonce) == 0) return;
  stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_REPLY, 0, status, text);
  event.command = nonce;
  events_.Push(event);
}

}  // namespace stridewire::client
