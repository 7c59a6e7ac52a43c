#pragma once

#include <vector>

#include "offline/base/frame_range.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// World paths of the points that tell where a figure walks: three of each foot and the pelvis.
/// All vectors have one value a frame of `frames`, so index 0 is frame `frames.begin`.
struct BodyTracks {
  struct FootTrajectory {
    std::vector<DVec3> ankle_m;
    std::vector<DVec3> ball_m;
    std::vector<DVec3> toe_tip_m;
  };

  FrameRange frames;  ///< Of the clip; the artificial first frame is left out.
  double fps = 0.0;
  FootTrajectory feet[2];  ///< Indexed by Foot
  std::vector<DVec3> pelvis_m;
  std::vector<double> pelvis_speed_m_s;  ///< of the path smoothed over 60 ms
  std::vector<double> pelvis_yaw_rad;    ///< unwrapped, left positive

  [[nodiscard]] int size() const { return static_cast<int>(pelvis_m.size()); }
  [[nodiscard]] const FootTrajectory& foot(Foot f) const { return feet[static_cast<int>(f)]; }
};

/// Follows the points through frames [first_frame, end) of a clip of that skeleton.
[[nodiscard]] BodyTracks TrackBody(const Skeleton& skeleton, const Clip& clip, int first_frame);

/// Moving average over `window` frames (made odd), the ends repeated.
[[nodiscard]] std::vector<DVec3> SmoothPath(const std::vector<DVec3>& path, int window);

/// Speed by central differences, one-sided at the ends.
[[nodiscard]] std::vector<double> PathSpeed(const std::vector<DVec3>& path, double fps);

}  // namespace stridewire
