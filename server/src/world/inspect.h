#pragma once

#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::server {

/// What an avatar is doing, as AvatarState tells it: base frame, movement under way, queue. Without
/// nonce, world, avatar number and the times, which the runtime's avatar does not know;
/// `movement->started_s` is avatar time. Examples' sites are left out where they would take more
/// than `max_site_bytes`.
[[nodiscard]] protocol::AvatarState Inspect(const AvatarSimulation& avatar,
                                            std::size_t max_site_bytes);

}  // namespace stridewire::server
