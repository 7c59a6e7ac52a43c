#pragma once

#include <cstddef>

#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::server {

/// Describes an avatar for InspectAvatar: its base frame, its movement and its queue. The caller
/// must set nonce, world, avatar id, tick and times, and add the avatar's offset to
/// `movement->started_s`, which is in avatar time. Parameters of examples are omitted if they take
/// more than `max_site_bytes`.
[[nodiscard]] protocol::AvatarState Inspect(const AvatarSimulation& avatar,
                                            std::size_t max_site_bytes);

}  // namespace stridewire::server
