// Functions of a session that the application calls. They check arguments and create commands.

#include <algorithm>
#include <type_traits>
#include <utility>

#include "session_commands.h"
#include "stridewire/protocol/check.h"

namespace stridewire::client {

namespace {

constexpr std::size_t kMaxSubscriptions = 256;  // Per world.

stridewire_status ToStatus(ErrorCode code) {
  switch (code) {
    case ErrorCode::kOutOfRange: return STRIDEWIRE_OUT_OF_RANGE;
    case ErrorCode::kUnsupported: return STRIDEWIRE_UNSUPPORTED;
    default: return STRIDEWIRE_INVALID_ARGUMENT;
  }
}

}  // namespace

template <typename Message>
stridewire_status SessionCommands::Enqueue(stridewire_world world, Message message,
                                           std::size_t bytes, std::uint64_t& command) {
  // `seq` and `world` are set when the command is sent. All other fields are checked now, so that
  // the call can report errors.
  message.seq = 1;
  if constexpr (requires { message.world; }) message.world = 1;
  if (Status status = protocol::Check(message); !status) {
    return Refuse(ToStatus(status.error().code), Describe(status.error()));
  }
  constexpr bool kChangesWorld = std::is_same_v<Message, protocol::Observe> ||
                                 std::is_same_v<Message, protocol::LeaveWorld> ||
                                 std::is_same_v<Message, protocol::StopObserving>;
  if (!IsOpen() && !(kChangesWorld && options_.keep_worlds)) {
    return Refuse(STRIDEWIRE_CLOSED, "the client is not connected");
  }
  const auto found = worlds_.find(world);
  if (found == worlds_.end()) return Refuse(STRIDEWIRE_NO_SUCH_WORLD, "no world has this number");
  if (found->second.state == World::State::kRefused || found->second.state == World::State::kLeft) {
    return Refuse(STRIDEWIRE_NOT_JOINED, "the world is not joined");
  }
  bytes += sizeof(Command);
  if (command_count_ >= options_.max_commands ||
      command_bytes_ + bytes > options_.max_command_bytes) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many commands are unanswered");
  }
  ++command_count_;
  command_bytes_ += bytes;
  command = next_command_++;
  found->second.unsent.push_back(Command{command, world, false, bytes, std::move(message)});
  return STRIDEWIRE_OK;
}

stridewire_status SessionCommands::JoinWorld(std::string_view name, protocol::Role role,
                                             stridewire_world& world, std::uint64_t& command) {
  if (Status status = protocol::Check(protocol::JoinWorld{1, std::string(name), role}); !status) {
    return Refuse(ToStatus(status.error().code), Describe(status.error()));
  }
  if (!IsOpen() && !options_.keep_worlds) {
    return Refuse(STRIDEWIRE_CLOSED, "the client is not connected");
  }
  for (auto& [handle, other] : worlds_) {
    if (other.name == name && other.state != World::State::kRefused) {
      return Refuse(STRIDEWIRE_ALREADY_JOINED, "a world of this name is already joined");
    }
  }
  // A world that the server refused can be joined again.
  std::erase_if(worlds_, [&](const auto& entry) {
    return entry.second.name == name && entry.second.state == World::State::kRefused;
  });
  if (worlds_.size() >= kMaxWorlds) {
    return Refuse(STRIDEWIRE_LIMIT_REACHED, "too many worlds are joined");
  }
  if (command_count_ >= options_.max_commands) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many commands are unanswered");
  }
  world = next_world_++;
  command = next_command_++;
  ++command_count_;
  World joined;
  joined.name = name;
  joined.role = role;
  joined.join_command = command;
  joined.view = std::make_unique<WorldView>(
      options_.pose_history, pose_budget_,
      PoseRecording(options_.recording_s, options_.max_recording_bytes), options_.evaluation);
  worlds_.emplace(world, std::move(joined));
  Pump();
  return STRIDEWIRE_OK;
}

stridewire_status SessionCommands::LeaveWorld(stridewire_world world, std::uint64_t& command) {
  if (stridewire_status status = Enqueue(world, protocol::LeaveWorld{}, 0, command);
      status != STRIDEWIRE_OK) {
    return status;
  }
  World& left = worlds_.at(world);
  const bool never_sent = left.state == World::State::kWanted;
  left.state = World::State::kLeft;
  if (never_sent) {
    const Command leave = std::move(left.unsent.back());
    left.unsent.pop_back();
    FailUnsent(left, STRIDEWIRE_NOT_JOINED, "the client left the world");
    if (!left.join_answered) {
      Answer(Command{left.join_command, world, false, 0, {}}, STRIDEWIRE_NOT_JOINED,
             "the client left the world");
    }
    Answer(leave, STRIDEWIRE_OK);
    worlds_.erase(world);
  }
  Pump();
  return STRIDEWIRE_OK;
}

template <typename Message>
stridewire_status SessionCommands::SendCommand(stridewire_world world, Message message,
                                               std::size_t bytes, std::uint64_t& command) {
  const stridewire_status status = Enqueue(world, std::move(message), bytes, command);
  Pump();
  return status;
}

stridewire_status SessionCommands::Spawn(stridewire_world world, protocol::Spawn message,
                                         std::uint64_t& command) {
  const std::size_t bytes = message.items.size() * sizeof(protocol::SpawnItem);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status SessionCommands::Remove(stridewire_world world, protocol::Remove message,
                                          std::uint64_t& command) {
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarId);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status SessionCommands::Request(stridewire_world world, protocol::Request message,
                                           std::uint64_t& command) {
  const std::size_t bytes = message.items.size() * sizeof(protocol::RequestItem);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status SessionCommands::Cancel(stridewire_world world, protocol::CancelQueue message,
                                          std::uint64_t& command) {
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarId);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status SessionCommands::SetTerrain(stridewire_world world, protocol::SetTerrain message,
                                              std::uint64_t& command) {
  const std::size_t bytes = TerrainBytes(message.terrain);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status SessionCommands::SetLayers(stridewire_world world, protocol::SetLayers message,
                                             std::uint64_t& command) {
  const std::size_t bytes =
      message.items.size() * (sizeof(protocol::LayerItem) + protocol::kMaxNameBytes);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status SessionCommands::SetPlanting(stridewire_world world,
                                               protocol::SetPlanting message,
                                               std::uint64_t& command) {
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarId);
  return SendCommand(world, std::move(message), bytes, command);
}

stridewire_status SessionCommands::Observe(stridewire_world world, protocol::Observe message,
                                           std::uint32_t& subscription, std::uint64_t& command) {
  if (const auto found = worlds_.find(world);
      found != worlds_.end() && found->second.subscriptions.size() >= kMaxSubscriptions) {
    return Refuse(STRIDEWIRE_LIMIT_REACHED, "too many subscriptions of one world");
  }
  message.subscription = next_subscription_;
  const std::size_t bytes = message.avatars.size() * sizeof(protocol::AvatarId);
  if (stridewire_status status = Enqueue(world, message, bytes, command); status != STRIDEWIRE_OK) {
    return status;
  }
  subscription = next_subscription_++;
  World& w = worlds_.at(world);
  w.subscriptions.emplace(subscription, Subscription{std::move(message)});
  UpdateFilter(w);
  Pump();
  return STRIDEWIRE_OK;
}

stridewire_status SessionCommands::MoveRegion(std::uint32_t subscription, protocol::Region region,
                                              std::uint64_t& command) {
  for (auto& [handle, world] : worlds_) {
    const auto found = world.subscriptions.find(subscription);
    if (found == world.subscriptions.end() || !found->second.message.region) continue;
    protocol::Observe message = found->second.message;
    message.region = std::move(region);
    message.replace = true;
    if (stridewire_status status = Enqueue(handle, message, 0, command); status != STRIDEWIRE_OK) {
      return status;
    }
    found->second.message.region = std::move(message.region);
    if (!IsOpen()) ChangeWhileClosed(world, subscription, &found->second.message);
    Pump();
    return STRIDEWIRE_OK;
  }
  return Refuse(STRIDEWIRE_NO_SUCH_SUBSCRIPTION, "no region has this subscription number");
}

void SessionCommands::ChangeWhileClosed(World& world, std::uint32_t subscription,
                                        const protocol::Observe* moved) {
  const Command change = std::move(world.unsent.back());
  world.unsent.pop_back();
  const auto observe = std::ranges::find_if(world.unsent, [&](const Command& command) {
    const auto* message = std::get_if<protocol::Observe>(&command.message);
    return message != nullptr && message->subscription == subscription;
  });
  if (observe != world.unsent.end() && moved != nullptr) {
    observe->message = *moved;
  } else if (observe != world.unsent.end()) {
    Answer(*observe, STRIDEWIRE_CANCELLED, "the subscription was stopped");
    world.unsent.erase(observe);
  }
  Answer(change, STRIDEWIRE_OK);
}

stridewire_status SessionCommands::Inspect(stridewire_world world, protocol::AvatarId avatar,
                                           std::uint64_t& nonce) {
  const auto found = worlds_.find(world);
  if (state_ != State::kReady || found == worlds_.end() || found->second.server_id == 0) {
    return Refuse(STRIDEWIRE_NOT_READY, "the world is not joined");
  }
  if (inspections_.size() >= kMaxInspections) {
    return Refuse(STRIDEWIRE_COMMANDS_FULL, "too many inspections are unanswered");
  }
  const protocol::InspectAvatar query{next_command_++, found->second.server_id, avatar};
  if (Status status = encoder_.Encode(query, output_); !status) {
    return Refuse(ToStatus(status.error().code), Describe(status.error()));
  }
  nonce = query.nonce;
  inspections_.emplace(nonce, heard_s_ + kInspectTimeoutS);
  return STRIDEWIRE_OK;
}

stridewire_status SessionCommands::StopObserving(std::uint32_t subscription,
                                                 std::uint64_t& command) {
  for (auto& [handle, world] : worlds_) {
    const auto found = world.subscriptions.find(subscription);
    if (found == world.subscriptions.end()) continue;
    if (stridewire_status status =
            Enqueue(handle, protocol::StopObserving{1, subscription}, 0, command);
        status != STRIDEWIRE_OK) {
      return status;
    }
    world.subscriptions.erase(found);
    if (!IsOpen()) ChangeWhileClosed(world, subscription, nullptr);
    if (world.subscriptions.empty()) world.view->ClearPoses();
    if (EveryNTicks(world, protocol::PoseMode::kMovement) == 0) world.replicas.reset();
    UpdateFilter(world);
    Pump();
    return STRIDEWIRE_OK;
  }
  return Refuse(STRIDEWIRE_NO_SUCH_SUBSCRIPTION, "no subscription has this number");
}

}  // namespace stridewire::client
