#pragma once

#include <vector>

#include "offline/base/frame_range.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// World trajectories from which movements are detected: three points per foot, the pelvis and the
/// trunk. All vectors have one value per frame of `frames`; index 0 is frame `frames.begin`.
struct BodyTracks {
  struct FootTrajectory {
    std::vector<DVec3> ankle_m;
    std::vector<DVec3> ball_m;
    std::vector<DVec3> toe_tip_m;
  };

  FrameRange frames;  ///< Frames of the clip, without an artificial pose at the start.
  double fps = 0.0;
  FootTrajectory feet[2];  ///< Trajectories of the two feet, indexed by Foot.
  std::vector<DVec3> pelvis_m;
  std::vector<double> pelvis_speed_m_s;  ///< Speed along the path smoothed over 60 ms.
  /// Unwrapped yaw of the pelvis; positive is left. The direction from the right to the left hip
  /// joint is 90 degrees to the left of it.
  std::vector<double> pelvis_yaw_rad;
  /// Mean position of all joints except the root and the joints of the legs, weighted by bone
  /// length. Empty if there are none.
  std::vector<DVec3> trunk_m;
  double leg_length_m = 0.9;  ///< Length of thigh plus shank, averaged over both legs.

  [[nodiscard]] int size() const { return static_cast<int>(pelvis_m.size()); }
  [[nodiscard]] const FootTrajectory& foot(Foot f) const { return feet[static_cast<int>(f)]; }
};

/// Returns the length of thigh plus shank in metres, averaged over both legs.
[[nodiscard]] double LegLength(const Skeleton& skeleton);

/// Computes the tracks for frames [first_frame, end) of a clip.
[[nodiscard]] BodyTracks TrackBody(const Skeleton& skeleton, const Clip& clip, int first_frame);

/// Returns the moving average over `window` frames. An even window is extended by one frame. The
/// end values are repeated beyond the ends.
[[nodiscard]] std::vector<DVec3> SmoothPath(const std::vector<DVec3>& path, int window);

/// Returns the speed along a path by central differences, one-sided at the ends.
[[nodiscard]] std::vector<double> PathSpeed(const std::vector<DVec3>& path, double fps);

}  // namespace stridewire
