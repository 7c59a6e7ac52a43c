#pragma once

#include <string>
#include <vector>

#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// One movement, cut out of a capture or generated. It starts at its first keytime at time 0, with
/// the root at x = z = 0 and heading 0. Heights (y) are relative to the ground under the fixed
/// foot. The clip covers [0, last keytime] and may contain later frames.
struct RawExample {
  Clip clip;
  /// [frame]: times of the frames of `clip`, if they are not evenly spaced. They increase from 0.
  std::vector<double> frame_times_s;
  std::vector<double> keytimes_s;   ///< K_0 = 0 < ... < K_n.
  std::vector<double> parameters;   ///< One value per parameter in RawGroup::parameters.
  double heading_change_rad = 0.0;  ///< Heading at the end relative to the start.
  /// Origin of the example: "16_21.bvh 0.93-1.47 s" or "generated step 0.35 to 0.55 m".
  std::string source;
  bool mirrored = false;
};

/// Examples of one kind that are blended with each other. All have the same number of keytimes.
struct RawGroup {
  MovementKind kind = MovementKind::kStepLeft;
  std::vector<ParameterName> parameters;
  std::vector<RawExample> examples;
  /// True if all examples were generated because the captures lack such movements. LibraryBuilder
  /// stores all of them. Requests prefer captured groups that fit nearly as well.
  bool is_completed = false;
};

/// Input for a LayerClip, which is blended over movements. `clip` contains all joints of the
/// skeleton, and `weights` selects those that the layer affects.
struct RawLayer {
  std::string name;
  /// Motion of the layer. If `is_looping`, its last frame equals the first.
  Clip clip;
  std::vector<float> weights;  ///< Weight of each joint, in [0, 1]; 0 for the root and the legs.
  bool is_looping = true;
  std::string source;
};

/// The editable form of a motion library. LibraryBuilder converts it to an immutable MotionLibrary.
struct RawLibrary {
  Skeleton skeleton;
  /// Standing pose. The root is at x = z = 0 with heading 0, and y is its height above the ground.
  Pose stand_pose;
  /// Deviation of the feet in `stand_pose` from flat feet. For both ankles and both toe tips, the
  /// height above the ball is compared with that of a flat foot. The deviation is the sum of the
  /// parts of these absolute differences that exceed 1.5 cm. If it is too large, CompleteLibrary
  /// replaces the stand pose.
  double stand_tilt_m = 0.0;
  std::vector<RawGroup> groups;
  std::vector<RawLayer> layers;
};

}  // namespace stridewire
