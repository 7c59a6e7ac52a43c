#pragma once

#include <string>
#include <vector>

#include "offline/base/frame_range.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// A joint that turned, or the root that moved, faster than a body can.
struct JointFlip {
  int joint = 0;
  FrameRange frames;        ///< Of the clip: the frames that were replaced, or around the flip.
  double angle_rad = 0.0;   ///< Largest turn between two neighbouring frames,
  double distance_m = 0.0;  ///< or how far the root left its path (angle 0).
};

struct GlitchReport {
  std::vector<JointFlip> repaired;
  std::vector<JointFlip> left;  ///< Could not be mended; movements across them are no examples.
};

/// Mends capture glitches of a few frames in place, from frame `first_frame` on (earlier ones are
/// not looked at):
///
/// - a joint that jumps (more than 1800 degrees/s between frames) and is back within 40 ms is
///   interpolated over the bad frames (slerp);
/// - a jump within 40 ms of either end of the recording: the few frames beyond it are replaced by
///   the nearest good one;
/// - a jump that stays is spread over 80 ms when it is small (up to 45 degrees) or less than 15 cm
///   of the body lie beyond the joint (fingers, thumbs, toes, which flip by up to 180 degrees);
/// - any other is left and reported;
/// - a root that leaves its path (the median over five frames) by more than 1 cm and what 40 m/s^2
///   may do in a frame is interpolated.
GlitchReport RepairGlitches(const Skeleton& skeleton, int first_frame, Clip& clip);

/// "LeftArm turns 94 degrees at once at 0.02 s".
[[nodiscard]] std::string DescribeFlip(const Skeleton& skeleton, const JointFlip& flip, double fps);

/// One sentence a joint about what was mended, in joint order.
[[nodiscard]] std::vector<std::string> DescribeRepairs(const Skeleton& skeleton,
                                                       const GlitchReport& report, double fps);

}  // namespace stridewire
