#pragma once

#include "net/transport.h"
#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/base/error.h"
#include "stridewire/protocol/messages.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/terrain.h"

/// Conversions between the types of the runtime and those of the protocol, which do not depend on
/// each other.
namespace stridewire::server {

[[nodiscard]] protocol::SkeletonInfo ToWire(const Skeleton& skeleton);
[[nodiscard]] protocol::Placement ToWire(const BaseFrame& base);
[[nodiscard]] BaseFrame FromWire(const protocol::Placement& placement);
[[nodiscard]] MovementRequest FromWire(const protocol::RequestItem& item);
/// `avatar` is not set; the caller must set it.
[[nodiscard]] protocol::RequestItem ToWire(const MovementRequest& request);

[[nodiscard]] protocol::TerrainInfo ToWire(const TerrainData& terrain);
[[nodiscard]] TerrainData FromWire(protocol::TerrainInfo&& terrain);

/// `avatar`, `tick` and `time_s` are not set, because the runtime's event does not contain them.
/// The caller must set them.
[[nodiscard]] protocol::Event ToWire(const AvatarEvent& event, const MotionLibrary& library);

/// Returns the status code that clients receive for an error of the runtime.
[[nodiscard]] protocol::StatusCode ToStatusCode(ErrorCode code);

/// Returns the status code that clients receive for an invalid frame.
[[nodiscard]] protocol::StatusCode FrameStatusCode(ErrorCode code);

/// Returns the WebSocket close code that follows a fatal error.
[[nodiscard]] CloseCode CloseCodeOf(protocol::StatusCode code);

}  // namespace stridewire::server
