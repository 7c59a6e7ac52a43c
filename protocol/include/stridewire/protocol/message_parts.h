#pragma once

#include <cstdint>

/// Names that the generated structs of messages use. Include messages.h instead.
namespace stridewire::protocol {

using WorldId = std::uint32_t;   ///< Assigned by the server, never 0.
using AvatarId = std::uint32_t;  ///< Id of an avatar, unique within its world and never 0.
/// Chosen by the client; unique within its session, never 0.
using SubscriptionId = std::uint32_t;
/// Chosen by the client. 0: no request, for example for a step that the server inserted.
using RequestId = std::uint64_t;

/// Sequence number of a command in its session: 1, 2, 3, ... (STATE_MACHINE.md, "Commands").
using Seq = std::uint64_t;

/// Flag of an avatar in a batch: do not interpolate from its previous pose. Receivers ignore
/// unknown flags.
inline constexpr std::uint8_t kPoseDiscontinuity = 1;
/// Flag of an avatar in a batch: it stands and its queue is empty.
inline constexpr std::uint8_t kPoseStanding = 2;
/// Flag of an avatar in a compact batch: its pose is outside the range of the world's quantization
/// and has the layout of PoseMode::kQuantised.
inline constexpr std::uint8_t kPoseUncompressed = 4;

/// Flag of an avatar in Movements, besides kPoseDiscontinuity: the avatar is gone and has no
/// record.
inline constexpr std::uint8_t kMovementGone = 4;

}  // namespace stridewire::protocol
