// Functions of a session that send commands and end them.

#include "session_commands.h"

#include <algorithm>
#include <utility>

#include "base/check.h"

namespace stridewire::client {

namespace {

// Estimated memory of an evaluated avatar, in addition to its pose history. It limits the number of
// such avatars.
constexpr std::size_t kReplicaBytes = std::size_t{16} << 10;

}  // namespace

bool SessionCommands::MaySend() const {
  const std::size_t max_unanswered =
      std::clamp<std::size_t>(limits_.reply_memory, 1, protocol::kReplyCache);
  return output_.size() < kMaxOutputBytes && unanswered_.size() < max_unanswered;
}

void SessionCommands::Pump() {
  if (state_ != State::kReady) return;

  // Commands that the server may have received before the resume are sent first, in order.
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
      // The command was encoded before, so this fails only if the server has lowered its limits.
      // When the server receives the next command, it closes the connection, because a sequence
      // number is missing.
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
      if (readiness == Readiness::kAnswered) {
        world.unsent.pop_front();
        continue;
      }
      Command command = std::move(world.unsent.front());
      world.unsent.pop_front();
      Send(std::move(command));
    }
  }
  RequestLibraries();
}

SessionCommands::Readiness SessionCommands::PrepareMovements(World& world, const Command& command) {
  const auto* observe = std::get_if<protocol::Observe>(&command.message);
  if (observe == nullptr || observe->mode != protocol::PoseMode::kMovement ||
      !world.subscriptions.contains(observe->subscription)) {
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
    return Readiness::kAnswered;
  }
  if (*library == nullptr) return Readiness::kWaits;
  if (world.replicas == nullptr) {
    world.replicas = std::make_unique<ReplicaSet>(*library, 1.0 / tick_hz_,
                                                  options_.max_pose_bytes / kReplicaBytes);
  }
  return Readiness::kReady;
}

void SessionCommands::RequestLibraries() {
  if (state_ != State::kReady) return;
  const auto may_request = [&](const std::string& hash) {
    return std::ranges::any_of(worlds_, [&](const auto& item) {
      const World& world = item.second;
      return world.server_id != 0 && world.view->library_hash() == hash;
    });
  };
  if (const auto request = libraries_.TakeRequest(may_request)) {
    const Status status = encoder_.Encode(*request, output_);
    if (!status) last_text_ = Describe(status.error());
  }
}

void SessionCommands::OnLibraryTask(const std::string& hash,
                                    Expected<std::shared_ptr<const MotionLibrary>> result) {
  libraries_.OnTask(hash, std::move(result));
  Pump();
}

void SessionCommands::Send(Command command) {
  const World& world = worlds_.at(command.world);
  const Status status = std::visit(
      [&](auto& message) {
        message.seq = next_seq_;
        if constexpr (requires { message.world; }) message.world = world.server_id;
        return encoder_.Encode(message, output_);
      },
      command.message);
  if (!status) {
    // The command exceeds the limits of the server. Its sequence number is not used.
    Answer(command, STRIDEWIRE_LIMIT_REACHED, Describe(status.error()));
    return;
  }
  STRIDEWIRE_CHECK(unanswered_.empty() || unanswered_.rbegin()->first < next_seq_);
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

void SessionCommands::Answer(const Command& command, stridewire_status status,
                             std::string_view text, std::uint32_t accepted) {
  if (command.own) {
    if (status == STRIDEWIRE_OK) return;
    events_.Push(MakeEvent(STRIDEWIRE_EVENT_NOTICE, command.world, status, text));
    return;
  }
  STRIDEWIRE_CHECK(command_count_ > 0 && command_bytes_ >= command.bytes);
  --command_count_;
  command_bytes_ -= command.bytes;
  stridewire_event event = MakeEvent(STRIDEWIRE_EVENT_REPLY, command.world, status, text);
  event.command = command.id;
  event.accepted = accepted;
  events_.Push(event);
}

void SessionCommands::FailUnsent(World& world, stridewire_status status, std::string_view text) {
  for (const Command& command : std::exchange(world.unsent, {})) Answer(command, status, text);
}

void SessionCommands::FailAll(stridewire_status status, std::string_view text) {
  for (const auto& [seq, command] : std::exchange(unanswered_, {})) {
    if (std::holds_alternative<protocol::JoinWorld>(command.message) &&
        worlds_.contains(command.world)) {
      continue;  // These commands are answered below, together with their worlds.
    }
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
