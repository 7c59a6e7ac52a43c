#pragma once

#include <memory>
#include <vector>

#include "runtime/skeleton/leg_rig.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Length of the loop of the idle motion, in seconds.
inline constexpr double kIdleLoopS = 40.0;

/// Motion of standing avatars, which is generated from the stand pose when a library is opened.
/// Both groups have the kind kStand, one example and no parameters, and are evaluated like steps.
///
/// - settle: the stand pose. An avatar blends into it after its last movement.
/// - idle: a loop of breathing, sway and weight shifts, which takes kIdleLoopS. The group also
///   contains a repetition of the first 2 s after the loop, so that a blend that begins late in the
///   loop has time to fade out.
///
/// The feet do not move. The same skeleton and stand pose give the same bits on every machine.
struct StandMotion {
  /// `rig.is_usable` must be true.
  StandMotion(const Skeleton& skeleton, const LegRig& rig, const Pose& stand_pose);
  StandMotion(const StandMotion&) = delete;
  StandMotion& operator=(const StandMotion&) = delete;

  MotionGroup settle;
  MotionGroup idle;

 private:
  // A part of a grid row, aligned as the kernels require.
  struct alignas(64) RowPart {
    float floats[16] = {};
  };
  std::vector<RowPart> settle_grid_;
  std::vector<RowPart> idle_grid_;
};

}  // namespace stridewire
