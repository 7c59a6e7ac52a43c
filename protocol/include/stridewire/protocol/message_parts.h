#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/base/rotation_quantization.h"
#include "stridewire/protocol/frame.h"
#include "stridewire/protocol/limits.h"
#include "stridewire/protocol/pose_codec.h"
#include "stridewire/protocol/status_code.h"

/// Names that the generated structs of messages use. Include messages.h instead.
namespace stridewire::protocol {

using WorldId = std::uint32_t;   ///< Assigned by the server, never 0.
using AvatarId = std::uint32_t;  ///< Id of an avatar, unique within its world and never 0.
/// Chosen by the client; unique within its session, never 0.
using SubscriptionId = std::uint32_t;
using RequestId = std::uint64_t;  ///< Chosen by the client. 0: a step that the server inserted.

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

/// Parameters of a movement. The names are 0 start_x_m, 1 start_y_m, 2 start_z_m, 3 end_x_m,
/// 4 end_y_m, 5 end_z_m, 6 turn_rad, 7 length_m, 8 height_m.
struct ParameterSet {
  std::array<std::uint8_t, kMaxParameters> names{};
  std::array<double, kMaxParameters> values{};
  std::uint8_t count = 0;  ///< Number of valid entries. All further entries are 0.
  bool operator==(const ParameterSet&) const = default;
};

}  // namespace stridewire::protocol
