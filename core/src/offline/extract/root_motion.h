#pragma once

#include <vector>

#include "offline/extract/body_tracks.h"

namespace stridewire {

/// The motion of the ground below a figure that stays in place, as on a treadmill: the supporting
/// foot stands still on the ground, so the ground moves with it.
struct GroundTravel {
  std::vector<DVec3> position_m;  ///< Horizontal path of the ground, one point per frame.
  double length_m = 0.0;          ///< Length of the path at the speed of a walk.
  /// Fraction of `length_m` during which the left foot is the supporting foot.
  double left_share = 0.0;
};

/// Measures the travel of the ground. It assumes level ground, so it is valid only for figures
/// whose pelvis stays in place. While both feet are in the air, the ground keeps its speed.
[[nodiscard]] GroundTravel MeasureGroundTravel(const BodyTracks& tracks);

/// Returns true if the figure walks on the spot: both feet in turn slide along the ground, while
/// the pelvis stays in place. Animations for games are often exported like this.
[[nodiscard]] bool WalksOnTheSpot(const BodyTracks& tracks, const GroundTravel& travel);

/// Moves the root such that the supporting foot stands still. The travel starts at frame
/// `first_frame` of the clip.
void AddRootMotion(const GroundTravel& travel, int first_frame, Clip& clip);

}  // namespace stridewire
