#pragma once

#include <cstdint>
#include <vector>

#include "pose_stamp.h"
#include "stridewire/base/math.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::client {

/// Properties of a sampled pose.
enum CrowdFlags : std::uint8_t {
  /// The last received pose at or before the sampled time must not be interpolated with the pose
  /// before it, for example because the avatar was teleported.
  kCrowdDiscontinuity = 1,
  kCrowdStanding = 2,       ///< The avatar stands and its queue is empty.
  kCrowdHeld = 4,           ///< The motion has stopped, because no later pose continues it.
  kCrowdReduced = 8,        ///< The server sent the pose with PoseDetail::kReduced.
  kCrowdRoot = 16,          ///< The server sent the pose with PoseDetail::kRoot.
  kCrowdExtrapolated = 32,  ///< The pose continues the motion after the newest pose.
};

/// Returns the flags of a received pose.
[[nodiscard]] inline std::uint8_t CrowdFlagsOf(const PoseStamp& stamp) {
  const int detail = stamp.detail == protocol::PoseDetail::kReduced ? kCrowdReduced
                     : stamp.detail == protocol::PoseDetail::kRoot  ? kCrowdRoot
                                                                    : 0;
  return static_cast<std::uint8_t>((stamp.discontinuity ? kCrowdDiscontinuity : 0) |
                                   (stamp.standing ? kCrowdStanding : 0) | detail);
}

/// Poses of many avatars at one time, in ascending order of avatar ids. Reuses its memory.
struct CrowdPose {
  std::size_t joint_count = 0;
  std::vector<protocol::AvatarId> avatars;
  std::vector<std::uint8_t> flags;  ///< CrowdFlags of each avatar.
  std::vector<Vec3> roots_m;        ///< World position of each root.
  std::vector<Quat> rotations;      ///< Joint rotations, `joint_count` per avatar.

  void Resize(std::size_t count, std::size_t joints) {
    joint_count = joints;
    avatars.resize(count);
    flags.resize(count);
    roots_m.resize(count);
    rotations.resize(count * joints);
  }
};

}  // namespace stridewire::client
