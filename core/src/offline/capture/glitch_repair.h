#pragma once

#include <string>
#include <vector>

#include "offline/base/frame_range.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// A joint that rotates, or a root that moves, faster than a human body can.
struct JointFlip {
  int joint = 0;
  /// The replaced frames, or the frames around a jump that was not repaired.
  FrameRange frames;
  double angle_rad = 0.0;  ///< Largest rotation between two successive frames; 0 for the root path.
  double distance_m = 0.0;  ///< Largest distance of the root from its smoothed path.
};

struct GlitchReport {
  std::vector<JointFlip> repaired;
  /// Jumps that were not repaired. Movements that contain them are not usable.
  std::vector<JointFlip> left;
};

/// Repairs capture glitches of a few frames in place. Frames before `first_frame` are ignored.
///
/// - A joint jumps if it rotates by more than 1800 degrees/s between frames. This limit is at least
///   12 and at most 60 degrees per frame. If the joint returns within 40 ms, the frames in between
///   are interpolated by slerp.
/// - If a joint jumps within 40 ms of either end of the recording, the nearest good frame replaces
///   the frames beyond the jump.
/// - A jump without return is spread over 80 ms if it is at most 45 degrees, or if the body extends
///   less than 15 cm beyond the joint. Fingers, thumbs and toes flip by up to 180 degrees.
/// - Other jumps remain and are reported.
/// - The root is interpolated where it deviates too far from the median over five frames. The limit
///   is 1 cm or, if larger, 40 m/s^2 times the square of the time between frames.
GlitchReport RepairGlitches(const Skeleton& skeleton, int first_frame, Clip& clip);

/// Returns a description such as "LeftArm turns 94 degrees in one frame at 0.02 s".
[[nodiscard]] std::string DescribeFlip(const Skeleton& skeleton, const JointFlip& flip, double fps);

/// Returns one sentence per repaired joint, in joint order.
[[nodiscard]] std::vector<std::string> DescribeRepairs(const Skeleton& skeleton,
                                                       const GlitchReport& report, double fps);

}  // namespace stridewire
