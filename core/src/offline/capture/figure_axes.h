#pragma once

#include <optional>
#include <string>

#include "offline/capture/bvh_figure.h"
#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/offline/bvh_reader.h"

namespace stridewire {

/// Rotations from the axes of a file to Stridewire's axes, in which +Y is up. If the figure stands
/// in the rest pose, it faces +Z after the rotation.
struct FigureAxes {
  BvhAxis up = BvhAxis::kPlusY;            ///< The up axis of the file.
  UpSource up_source = UpSource::kOption;  ///< What determined `up`.
  bool rest_stands = false;                ///< True if the rest pose is standing.
  /// Rotation from the world axes of the file to those of Stridewire.
  DQuat world_turn = DQuat(1.0, 0.0, 0.0, 0.0);
  /// Rotation from the axes of the file's joint frames to those of the converted joint frames.
  DQuat joint_turn = DQuat(1.0, 0.0, 0.0, 0.0);
};

/// Determines the axes of a figure. The up axis is `up` if it is set. Otherwise there are two
/// estimates: the up axis of a standing rest pose, and the mean direction from the feet to the hips
/// over the motion. If they differ, the rest pose decides unless the figure clearly stands along
/// the other axis in the motion.
///
/// If joint names do not contain the sides of the legs, the function determines the sides from the
/// direction of the feet, and swaps the legs of `figure` if necessary. It adds notes to `figure`.
///
/// Errors: kUnsupported if left and right cannot be determined.
[[nodiscard]] Expected<FigureAxes> FindFigureAxes(BvhFigure& figure, std::optional<BvhAxis> up,
                                                  const std::string& name);

}  // namespace stridewire
