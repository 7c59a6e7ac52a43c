#pragma once

#include <cstdint>

#include "stridewire/protocol/pose_codec.h"

namespace stridewire::client {

/// Metadata of a pose: all its properties except root position and rotations.
struct PoseStamp {
  std::uint64_t tick = 0;
  double time_s = 0.0;         ///< Server time in seconds.
  bool discontinuity = false;  ///< The client must not interpolate from the previous pose.
  /// Consecutive poses with equal segments belong to one continuous motion and may be interpolated.
  std::uint32_t segment = 0;
  bool standing = false;  ///< The avatar stands and its queue is empty.
  protocol::PoseDetail detail = protocol::PoseDetail::kAll;
};

}  // namespace stridewire::client
