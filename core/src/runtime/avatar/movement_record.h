#pragma once

#include <cstddef>
#include <vector>

#include "runtime/avatar/avatar_simulation.h"

namespace stridewire {

/// Movement records carry the state of an avatar to its replicas (AvatarReplica). Their bytes are
/// described in protocol/STANDARD.md under "Movement records". There are two kinds:
///
/// - A change contains what the last Advance changed (AvatarChange). For a new movement it contains
///   only the decisions: group, weights, heading and footprints. The replica derives the rest, such
///   as the difference pose, from the previous movement.
/// - A state contains everything, for replicas without a previous state. It is several times as
///   long.

/// Appends a record of what the last Advance changed, or of the whole state if a change record
/// cannot express it. If only time has advanced, returns false and appends nothing. Allocates only
/// in `out`.
bool AppendChange(const AvatarSimulation& avatar, std::vector<std::byte>& out);

/// Appends a record of the whole state. The last call on the avatar must have been Advance.
void AppendState(const AvatarSimulation& avatar, std::vector<std::byte>& out);

/// Returns an upper bound on the size of a record of an avatar with this library.
[[nodiscard]] std::size_t MaxRecordBytes(const MotionLibrary& library);

}  // namespace stridewire
