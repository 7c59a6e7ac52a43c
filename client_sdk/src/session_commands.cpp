// The part of a session that sends commands and ends them, answered or not.

#include <algorithm>
#include <utility>

#include "session.h"

namespace stridewire::client {

namespace {

// Of an avatar whose poses are evaluated here: its part of the memory that all may have besides
// their histories.
constexpr std::size_t kReplicaBytes = std::size_t{16} << 10;

}  // namespace

bool Session::MaySend() const {
  const std::size_t memory =
      std::clamp<std::size_t>(limits_.reply_memory, 1, protocol::kReplyCache);
  return output_.size() < kMaxOutputBytes && unanswered_.size() < memory;
}

void Session::Pump() {
  if (state_ != State::kReady) return;

  // First what the server may have heard already, in order.
  while (resend_from_ != 0 && output_.size() < kMaxOutputBytes) {
    const auto next = unanswered_.lower_bound(resend_from_);
    if (next == unanswered_.end()) {
      resend_from_ = 0;
      break;
    }
    resend_from_ = next->first + 1;
    const Status status =
        std::visit([&](const auto& message) { return encoder_.Encode(message, output_); },
                   next->second.message);
    if (status) {
      ++commands_resent_;
    } else {
      // It could be encoded before; a server that has lowered its limits since gets a gap and says
      // so.
      last_text_ = Describe(status.error());
    }
  }
  if (resend_from_ != 0) return;

  for (auto& [handle, world] : worlds_) {
    if (world.state == World::State::kWanted && MaySend()) {
      world.state = World::State::kJoining;
      Send(Command{world.join_command, handle, world.join_answered, 0,
                   protocol::JoinWorld{0, world.name, world.role}});
    }
    while (world.server_id != 0 && !world.unsent.empty() && MaySend()) {
      const Readiness readiness = PrepareMovements(world, world.unsent.front());
      if (readiness == Readiness::kWaits) break;
      if (readiness == Readiness::kRefused) {
        world.unsent.pop_front();
        continue;
      }
      Command command = std::move(world.unsent.front());
      world.unsent.pop_front();
      Send(std::move(command));
    }
  }
  AskForLibraries();
}

Session::Readiness Session::PrepareMovements(World& world, const Command& command) {
  const auto* observe = std::get_if<protocol::Observe>(&command.message);
  if (observe == nullptr || observe->mode != protocol::PoseMode::kMovement ||
      !world.subscriptions.contains(observe->subscription) || !Understands(command.message)) {
    return Readiness::kReady;
  }
  auto library = libraries_.Get(world.view->library_hash());
  if (!library) {
    world.subscriptions.erase(observe->subscription);
    UpdateFilter(world);
    const ErrorCode code = library.error().code;
    Answer(command,
           code == ErrorCode::kUnsupported       ? STRIDEWIRE_UNSUPPORTED
           : code == ErrorCode::kVersionMismatch ? STRIDEWIRE_VERSION_MISMATCH
                                                 : STRIDEWIRE_MALFORMED,
           library.error().text);
    return Readiness::kRefused;
  }
  if (*library == nullptr) return Readiness::kWaits;
  if (world.evaluated == nullptr) {
    world.evaluated = std::make_unique<ReplicaSet>(*library, 1.0 / tick_hz_,
                                                   options_.max_pose_bytes / kReplicaBytes);
  }
  return Readiness::kReady;
}

void Session::AskForLibraries() {
  if (state_ != State::kReady || (features_ & protocol::kFeatureMovementMode) == 0) return;
  const auto may_request = [&](const std::string& hash) {
    return std::ranges::any_of(worlds_, [&](const auto& item) {
      const World& world = item.second;
      return world.server_id != 0 && world.view->library_hash() == hash;
    });
  };
  if (const auto question = libraries_.TakeRequest(may_request)) {
    const Status status = encoder_.Encode(*question, output_);
    if (!status) last_text_ = Describe(status.error());
  }
}

void Session::OnLibraryTask(const std::string& hash,
                            Expected<std::shared_ptr<const MotionLibrary>> result) {
  libraries_.OnTask(hash, std::move(result));
  Pump();
}

bool Session::Understands(const CommandMessage& message) const {
  if (std::holds_alternative<protocol::SetTerrain>(message)) {
    return (features_ & protocol::kFeatureTerrain) != 0;
  }
  if (std::holds_alternative<protocol::SetLayers>(message)) {
    return (features_ & protocol::kFeatureLayers) != 0;
  }
  if (std::holds_alternative<protocol::SetPlanting>(message)) {
    return (features_ & protocol::kFeaturePlanting) != 0;
  }
  if (const auto* observe = std::get_if<protocol::Observe>(&message)) {
    if (observe->region && (features_ & protocol::kFeatureRegions) == 0) return false;
    constexpr std::uint64_t kDetail = protocol::kFeatureDetail | protocol::kFeatureCompact;
    const bool has_details = observe->detail != protocol::PoseDetail::kAll ||
                             (observe->region && !observe->region->ring_details.empty());
    if (has_details && (features_ & kDetail) != kDetail) return false;
    return observe->mode != protocol::PoseMode::kMovement ||
           (features_ & protocol::kFeatureMovementMode) != 0;
  }
  const auto* request = std::get_if<protocol::Request>(&message);
  if (request == nullptr) return true;
  const bool knows_footprints = (features_ & protocol::kFeatureFootprints) != 0;
  const bool knows_walks = (features_ & protocol::kFeatureWalks) != 0;
  const bool knows_takeovers = (features_ & protocol::kFeatureTakeovers) != 0;
  const bool knows_refusals = (features_ & protocol::kFeatureRefusals) != 0;
  return std::ranges::none_of(request->items, [&](const protocol::RequestItem& item) {
    if (item.interrupt != protocol::Interrupt::kNone && !knows_takeovers) return true;
    if (std::holds_alternative<protocol::WalkMovement>(item.movement)) return !knows_walks;
    const auto* step = std::get_if<protocol::StepMovement>(&item.movement);
    if (step == nullptr) return false;
    return (step->at.has_value() && !knows_footprints) || (step->exact_only && !knows_refusals);
  });
}

void Session::Send(Command command) {
  if (!Understands(command.message)) {
    if (const auto* observe = std::get_if<protocol::Observe>(&command.message)) {
      World& refused = worlds_.at(command.world);
      refused.subscriptions.erase(observe->subscription);
      UpdateFilter(refused);
    }
    Answer(command, STRIDEWIRE_UNSUPPORTED, "this server does not know of it");
    return;
  }
  const World& world = worlds_.at(command.world);
  const Status status = std::visit(
      [&](auto& message) {
        message.seq = next_seq_;
        if constexpr (requires { message.world; }) message.world = world.server_id;
        return encoder_.Encode(message, output_);
      },
      command.message);
  if (!status) {
    // Larger than this server takes: its number was not used.
    Answer(command, STRIDEWIRE_LIMIT_REACHED, Describe(status.error()));
    return;
  }
  ++commands_sent_;
  if (const auto* observe = std::get_if<protocol::Observe>(&command.message)) {
    World& w = worlds_.at(command.world);
    if (const auto found = w.subscriptions.find(observe->subscription);
        found != w.subscriptions.end()) {
      found->second.unsent = false;
    }
  }
  unanswered_.emplace(next_seq_++, std::move(command));
}

void Session::Answer(const Command& command, stridewire_status status, std::string_view text,
                     std::uint32_t accepted) {
  if (command.own) {
    if (status == STRIDEWIRE_OK) return;
    events_.Push(MakeEvent(STRIDEWIRE_EVENT_NOTICE, command.world, status, text));
    return;
  }
  --command_count_;
  command_bytes_ -= command.bytes;
  stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_REPLY, command.world, status, text);
  event.command = command.id;
  event.accepted = accepted;
  events_.Push(event);
}

void Session::FailUnsent(World& world, stridewire_status status, std::string_view text) {
  for (const Command& command : std::exchange(world.unsent, {})) Answer(command, status, text);
}

void Session::FailAll(stridewire_status status, std::string_view text) {
  for (const auto& [seq, command] : std::exchange(unanswered_, {})) {
    if (std::holds_alternative<protocol::JoinWorld>(command.message)) continue;  // Below.
    Answer(command, status, text);
  }
  for (auto& [handle, world] : worlds_) {
    if (!world.join_answered) {
      world.join_answered = true;
      Answer(Command{world.join_command, handle, false, 0, {}}, status, text);
    }
    FailUnsent(world, status, text);
  }
}

}  // namespace stridewire::client
