#pragma once

#include <cstddef>
#include <vector>

#include "runtime/avatar/avatar_simulation.h"

namespace stridewire {

/// What an avatar's owner tells who shows the avatar elsewhere (AvatarReplica): bytes, as protocol/STANDARD.md
/// describes them under "Movement records". Two kinds:
///
///   change: what the last Advance changed (AvatarChange). Of a movement that began only what was decided is told: group,
///           weights, heading, where the feet land. What it goes on from, and the difference pose, are those of
///           who showed what was before; they come out the same there.
///   state:  all of it, for who showed nothing before. Some five to ten times as long.

/// Appends what the last Advance changed, the whole state if no less tells it; nothing if nothing but time went on.
/// Returns whether there was something. May allocate in `out` only.
bool AppendChange(const AvatarSimulation& avatar, std::vector<std::byte>& out);

/// Appends the state after the last Advance, which must be the last thing that was done to the avatar.
void AppendState(const AvatarSimulation& avatar, std::vector<std::byte>& out);

/// No record of an avatar of this library is longer.
[[nodiscard]] std::size_t MaxRecordBytes(const MotionLibrary& library);

}  // namespace stridewire
