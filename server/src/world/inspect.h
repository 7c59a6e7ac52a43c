#pragma once

#include <cstddef>

#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::server {

/// Describes an avatar for InspectAvatar: its base frame, movement, queue, layers and foot
/// planting. The caller must set `nonce`, `world`, `tick`, `server_time_s`, and `avatar` of the
/// state and of each queued request. It must also convert `movement->started_s` from the avatar's
/// time to server time. `movement->sites` is left empty if it would take more than
/// `max_site_bytes`.
[[nodiscard]] protocol::AvatarState Inspect(const AvatarSimulation& avatar,
                                            std::size_t max_site_bytes);

}  // namespace stridewire::server
