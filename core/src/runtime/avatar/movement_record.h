#pragma once

#include <cstddef>
#include <vector>

#include "runtime/avatar/avatar_simulation.h"

namespace stridewire {

/// Movement records carry the state of an avatar to its replicas (AvatarReplica). Their bytes are
/// described in protocol/STANDARD.md under "Movement records". There are two kinds:
///
///   change: what the last Advance changed (AvatarChange). For a new movement it contains only the
///           decisions: group, weights, heading and footprints. The replica derives the rest, such
///           as the difference pose, from the previous movement.
///   state:  everything, for replicas without a previous state. About five to ten times as long.

/// Appends a record of what the last Advance changed, or of the whole state if a change record
/// cannot express it. Returns false and appends nothing if only time advanced. Allocates only in
/// `out`.
bool AppendChange(const AvatarSimulation& avatar, std::vector<std::byte>& out);

/// Appends a record of the whole state. The last call on the avatar must have been Advance.
void AppendState(const AvatarSimulation& avatar, std::vector<std::byte>& out);

/// Upper bound on the size of a record of an avatar with this library.
[[nodiscard]] std::size_t MaxRecordBytes(const MotionLibrary& library);

}  // namespace stridewire
