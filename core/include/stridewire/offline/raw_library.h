#pragma once

#include <string>
#include <vector>

#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// A movement cut out of a capture (or generated), normalised: it starts at time 0 at its first
/// keytime with the root at x = z = 0 and heading 0; y is the height above the ground the fixed
/// foot stands on. The clip covers [0, last keytime]; frames beyond the last keytime are allowed.
struct RawExample {
  Clip clip;
  std::vector<double> keytimes_s;   ///< K_0 = 0 < … < K_n
  std::vector<double> parameters;   ///< One for each name of the group
  double heading_change_rad = 0.0;  ///< Heading at the end relative to the start (stride heading)
  std::string source;               ///< "16_21.bvh 0.93-1.47 s", "generated start 0.35 end 0.55"
  bool mirrored = false;
};

/// Examples of one kind that will be blended with each other. Same number of keytimes in all.
struct RawGroup {
  MovementKind kind = MovementKind::kStepLeft;
  std::vector<ParameterName> parameters;
  std::vector<RawExample> examples;
};

/// A clip that will be played over the movement (LayerClip), with all joints of the skeleton.
struct RawLayer {
  std::string name;
  Clip clip;                   ///< Of a loop, the last frame is the first.
  std::vector<float> weights;  ///< One a joint, in [0, 1]; 0 for the root and the legs
  bool is_looping = true;
  std::string source;
};

/// What a library is built from: the open, editable form. `LibraryBuilder` makes the immutable one.
struct RawLibrary {
  Skeleton skeleton;
  Pose stand_pose;  ///< Root at x = z = 0, heading 0, y above the ground
  std::vector<RawGroup> groups;
  std::vector<RawLayer> layers;
};

}  // namespace stridewire
