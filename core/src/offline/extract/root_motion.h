#pragma once

#include <vector>

#include "offline/extract/body_tracks.h"

namespace stridewire {

/// Motion of the ground below a figure that stays in place, as on a treadmill. The ground moves
/// like the supporting foot, which stands still on it.
struct GroundTravel {
  std::vector<DVec3> position_m;  ///< Horizontal path of the ground, one point per frame.
  /// Length of the path, without the parts in which both feet are in the air or the ground moves at
  /// 0.2 m/s or less.
  double length_m = 0.0;
  /// Fraction of `length_m` over which the left foot is the supporting foot.
  double left_share = 0.0;
};

/// Measures the motion of the ground. It assumes level ground and a pelvis that stays in place.
/// While both feet are in the air, the ground keeps its speed.
[[nodiscard]] GroundTravel MeasureGroundTravel(const BodyTracks& tracks);

/// Returns true if the figure walks on the spot: both feet slide along the ground in turn while the
/// pelvis stays in place. Animations for games are often exported in this form.
[[nodiscard]] bool WalksOnTheSpot(const BodyTracks& tracks, const GroundTravel& travel);

/// Moves the root so that the supporting foot stands still. `travel` starts at frame `first_frame`
/// of the clip.
void AddRootMotion(const GroundTravel& travel, int first_frame, Clip& clip);

}  // namespace stridewire
