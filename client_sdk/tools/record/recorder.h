#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/client.hpp"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire::record {

/// Options of a recording.
struct Options {
  std::string host;
  std::uint16_t port = 0;
  std::string world;
  std::uint32_t avatar = 0;
  double seconds = 0.0;
  stridewire_pose_mode mode = STRIDEWIRE_FULL;
  double timeout_s = 10.0;  ///< Maximum time to wait for the connection, the avatar and each pose.
  std::string token;
  /// Folder that caches libraries for STRIDEWIRE_MOVEMENT. Empty: no cache.
  std::string library_folder;
};

/// A run of frames that were not received.
struct Gap {
  int first_frame = 0;
  int frames = 0;
};

/// A restart of the server during a recording.
struct Restart {
  int frame = 0;      ///< First frame after the restart.
  double away_s = 0;  ///< Time without poses, measured by the clock of this machine.
};

/// A recorded motion.
struct Recording {
  Skeleton skeleton;
  Clip clip;  ///< Recorded motion with one frame per tick.
  std::string library_hash;
  std::uint64_t first_tick = 0;
  /// Number of ticks that were not received. Their frames are interpolated, or repeat the last pose
  /// before a discontinuity.
  std::uint64_t ticks_missing = 0;
  /// Runs of missing frames; at most kMaxGaps of them are listed.
  std::vector<Gap> gaps;
  std::uint64_t discontinuities = 0;
  /// Restarts of the server. A restarted server counts its ticks from 0, so the length of a gap is
  /// measured by the local clock. The frames of the gap repeat the last pose.
  std::vector<Restart> restarts;
  std::uint64_t bytes_received = 0;
  std::string cut_short;  ///< Reason why the recording is shorter than requested; empty: complete.
};

inline constexpr std::size_t kMaxGaps = 1000;

/// Records one avatar for `seconds` of server time, counted in ticks from the first received pose.
/// If the server restarts, the recording continues when the avatar is back. Waits at most
/// `timeout_s` for the connection, for the avatar and for each pose. Calls `progress`, unless it is
/// empty, with the number of recorded seconds. Fails with kIo if no pose arrives, for example
/// because the avatar does not exist, with kInvalidArgument for an invalid address, world name or
/// avatar id, and with kLimitExceeded for too many frames.
[[nodiscard]] Expected<Recording> Record(const Options& options,
                                         const std::function<void(double)>& progress);

}  // namespace stridewire::record
