#pragma once

#include "net/transport.h"
#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/base/error.h"
#include "stridewire/protocol/messages.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/terrain.h"

/// Between the runtime's values and the wire's, which know nothing of each other.
namespace stridewire::server {

[[nodiscard]] protocol::SkeletonInfo ToWire(const Skeleton& skeleton);
[[nodiscard]] protocol::Placement ToWire(const BaseFrame& base);
[[nodiscard]] BaseFrame FromWire(const protocol::Placement& placement);
[[nodiscard]] MovementRequest FromWire(const protocol::RequestItem& item);
/// Without avatar number.
[[nodiscard]] protocol::RequestItem ToWire(const MovementRequest& request);

[[nodiscard]] protocol::TerrainInfo ToWire(const TerrainData& terrain);
[[nodiscard]] TerrainData FromWire(protocol::TerrainInfo&& terrain);

/// Without avatar, tick and time, which the runtime's event does not have.
[[nodiscard]] protocol::Event ToWire(const AvatarEvent& event, const MotionLibrary& library);

/// What an error of the runtime is called on the wire.
[[nodiscard]] protocol::StatusCode ToStatusCode(ErrorCode code);

/// What a frame's error is called on the wire.
[[nodiscard]] protocol::StatusCode FrameStatusCode(ErrorCode code);

/// How a WebSocket ends after an Error of that code.
[[nodiscard]] CloseCode CloseCodeOf(protocol::StatusCode code);

}  // namespace stridewire::server
