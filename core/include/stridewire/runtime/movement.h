#pragma once

#include <array>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/keytimes.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Where a movement starts: a point on the support ground and a heading. Positions of a movement
/// are relative to it: world = position + R_y(heading) * local.
struct BaseFrame {
  DVec3 position_m = DVec3(0.0);
  double heading_rad = 0.0;  ///< Unwrapped: 2 pi is one full left turn.
};

/// One synthesized variation: everything that can be seen of an avatar while it lasts follows from
/// this value, its group and the time.
struct Movement {
  int group = -1;
  std::vector<float> weights;                          ///< [example], sum 1
  std::array<double, kMaxIntervals + 1> keytimes_s{};  ///< blended, K_0 = 0
  int interval_count = 0;
  TimeWarp warp;
  double heading_change_rad = 0.0;  ///< blended
  BaseFrame base;
  Pose difference;          ///< D = P - M(0), world frame
  double ease_out_s = 0.2;  ///< T = min(0.2 s, duration)

  [[nodiscard]] double duration_s() const {
    return keytimes_s[static_cast<std::size_t>(interval_count)];
  }
};

}  // namespace stridewire
