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

struct Options {
  std::string host;
  std::uint16_t port = 0;
  std::string world;
  std::uint32_t avatar = 0;
  double seconds = 0.0;
  stridewire_pose_mode mode = STRIDEWIRE_FULL;
  double timeout_s = 10.0;  ///< Longest wait for the connection, the avatar, and the next pose.
  std::string token;
  std::string library_folder;  ///< Empty: none
};

/// Frames that were not received.
struct Gap {
  int first_frame = 0;
  int frames = 0;
};

struct Recording {
  Skeleton skeleton;
  Clip clip;  ///< One frame a tick, as received.
  std::string library_hash;
  std::uint64_t first_tick = 0;
  std::uint64_t ticks_missing = 0;  ///< Not received; filled from their neighbours.
  std::vector<Gap> gaps;            ///< Where those are: the first kMaxGaps.
  std::uint64_t discontinuities = 0;
  std::uint64_t bytes_received = 0;
  std::string cut_short;  ///< Why there is less than was asked for; empty: there is not.
};

inline constexpr std::size_t kMaxGaps = 1000;

/// Watches one avatar for so many seconds of the server's time, counted in ticks from the first pose
/// received. Always ends: nothing is waited for longer than `timeout_s`. `progress`, if set, is
/// called with the seconds recorded. kIo: no connection, no such avatar, or other reasons why
/// nothing was recorded.
[[nodiscard]] Expected<Recording> Record(const Options& options,
                                         const std::function<void(double)>& progress);

}  // namespace stridewire::record
