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

/// Structs of messages that the build does not generate, because several messages contain them, or
/// they have member functions. Include messages.h instead.
namespace stridewire::protocol {

using WorldId = std::uint32_t;   ///< Assigned by the server, never 0.
using AvatarId = std::uint32_t;  ///< Id of an avatar, unique within its world and never 0.
/// Chosen by the client; unique within its session, never 0.
using SubscriptionId = std::uint32_t;
using RequestId = std::uint64_t;  ///< Chosen by the client. 0: a step that the server inserted.

/// Sequence number of a command in its session: 1, 2, 3, ... (STATE_MACHINE.md, "Commands").
using Seq = std::uint64_t;

/// Base frame of an avatar: its position and horizontal rotation.
struct Placement {
  DVec3 position_m = DVec3(0.0);
  double heading_rad = 0.0;  ///< Rotation about +Y, positive to the left, not wrapped.
  bool operator==(const Placement&) const = default;
};

/// The step or jump in reach that is nearest to a rejected one. The foot of a step, or the middle
/// between the feet of a jump, would land at Event::position_m.
struct NearestMovement {
  double length_m = 0.0;     ///< Same meaning as in StepMovement or JumpMovement.
  double side_m = 0.0;       ///< Same meaning as in StepMovement; 0 for jumps.
  double height_m = 0.0;     ///< Same meaning as in StepMovement or JumpMovement.
  double turn_rad = 0.0;     ///< Same meaning as in StepMovement or JumpMovement.
  double heading_rad = 0.0;  ///< Heading of the foot, or of the avatar after a jump.
  bool operator==(const NearestMovement&) const = default;
};

/// Flag of an avatar in a batch: do not interpolate from its previous pose. Receivers ignore
/// unknown flags.
inline constexpr std::uint8_t kPoseDiscontinuity = 1;
/// Flag of an avatar in a batch: it stands and its queue is empty.
inline constexpr std::uint8_t kPoseStanding = 2;
/// Flag of an avatar in a compact batch: its pose is outside the range of the world's quantization
/// and has the layout of PoseMode::kQuantised.
inline constexpr std::uint8_t kPoseUncompressed = 4;

/// Header of a batch. It contains nothing about a session, because the server encodes a batch once
/// and sends it to every observer of that world and mode.
struct PoseBatchInfo {
  WorldId world = 0;
  std::uint16_t shard = 0;
  std::uint16_t part = 0;  ///< Below `parts`.
  /// Number of frames of this batch. It is above 1 if the avatars of the shard do not fit in one
  /// frame.
  std::uint16_t parts = 1;
  std::uint64_t tick = 0;
  double server_time_s = 0.0;       ///< Server time of the tick.
  PoseMode mode = PoseMode::kFull;  ///< Mode of the poses: kFull, kQuantised or a compact mode.
  std::uint16_t joint_count = 0;    ///< 1 to kMaxJoints
  bool is_partial = false;          ///< True if an avatar that is not in the batch may still exist.
  bool operator==(const PoseBatchInfo&) const = default;
};

/// Poses of many avatars at one tick. Borrows its arrays: from the frame it was decoded from, or
/// from the caller of the encoder. Decoding checks the sizes of the arrays, and DecodePose checks
/// each pose. Root positions and rotations are in world space.
struct PoseBatch {
  static constexpr MessageType kType = MessageType::kPoseBatch;
  PoseBatchInfo info;
  std::span<const AvatarId> avatars;    ///< Ids of the avatars, at most kMaxItems, none of them 0.
  std::span<const std::uint8_t> flags;  ///< Flags of each avatar.
  /// Encoded poses, one after the other; see PoseBatchReader.
  std::span<const std::byte> poses;

  /// Bytes of the i-th pose of a full or quantised batch.
  [[nodiscard]] std::span<const std::byte> pose(std::size_t i) const {
    const std::size_t bytes = PoseBytes(info.mode, info.joint_count);
    return poses.subspan(i * bytes, bytes);
  }
};

/// Computes the size of each compressed pose of a compact batch; 0 if all poses are uncompressed.
/// Empty if the size of the batch does not match its flags.
[[nodiscard]] std::optional<std::size_t> CompactPoseBytes(const PoseBatch& batch);

/// Parameters of a movement. The names are 0 start_x_m, 1 start_y_m, 2 start_z_m, 3 end_x_m,
/// 4 end_y_m, 5 end_z_m, 6 turn_rad, 7 length_m, 8 height_m.
struct ParameterSet {
  std::array<std::uint8_t, kMaxParameters> names{};
  std::array<double, kMaxParameters> values{};
  std::uint8_t count = 0;  ///< Number of valid entries. All further entries are 0.
  bool operator==(const ParameterSet&) const = default;
};

/// Planned landing of a foot in the current movement.
struct Landing {
  FootSide foot = FootSide::kLeft;
  DVec3 position_m = DVec3(0.0);  ///< Position of the ball of the foot.
  double heading_rad = 0.0;       ///< Heading of the foot.
  bool operator==(const Landing&) const = default;
};

/// Flag of an avatar in Movements, besides kPoseDiscontinuity: the avatar is gone and has no
/// record.
inline constexpr std::uint8_t kMovementGone = 4;

/// Movement records of one shard, for clients that evaluate poses themselves (STANDARD.md,
/// "Movement records"). The avatars of a shard advance in steps of one tick. The server sends the
/// changes of every step in order, and the complete states of avatars that the client does not know
/// yet.
struct Movements {
  static constexpr MessageType kType = MessageType::kMovements;
  WorldId world = 0;
  std::uint16_t shard = 0;
  std::uint16_t part = 0;   ///< Below `parts`.
  std::uint16_t parts = 1;  ///< Number of messages that contain the changes of this step.
  /// Number of steps that follow before the poses of `tick` are displayed.
  std::uint16_t more_steps = 0;
  /// Step number of the shard. If numbers are missing, the client no longer knows the states of the
  /// shard's avatars.
  std::uint64_t step = 0;
  std::uint64_t tick = 0;
  double server_time_s = 0.0;  ///< Server time of the tick.
  /// True: the records are states after `step`. False: the records are changes in `step`.
  bool states = false;
  std::vector<AvatarId> avatars;    ///< Ids of the avatars, at most kMaxItems, none of them 0.
  std::vector<std::uint8_t> flags;  ///< Flags of each avatar.
  std::vector<std::uint32_t> ends;  ///< End of each avatar's record in `records`, in bytes.
  std::vector<std::byte> records;
  bool operator==(const Movements&) const = default;

  /// Bytes of the i-th avatar's record.
  [[nodiscard]] std::span<const std::byte> record(std::size_t i) const {
    const std::size_t begin = i == 0 ? 0 : ends[i - 1];
    return std::span(records).subspan(begin, ends[i] - begin);
  }
};

}  // namespace stridewire::protocol
