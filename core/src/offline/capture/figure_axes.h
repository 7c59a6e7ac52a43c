#pragma once

#include <optional>
#include <string>

#include "offline/capture/bvh_figure.h"
#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/offline/bvh_reader.h"

namespace stridewire {

/// Rotations from the axes of a file to ours: +Y up and, if the rest pose stands, facing +Z at
/// identity rotations.
struct FigureAxes {
  BvhAxis up = BvhAxis::kPlusY;            ///< The up axis of the file.
  UpSource up_source = UpSource::kOption;  ///< What determined `up`.
  bool rest_stands = false;                ///< The rest pose stands upright.
  /// Rotation from the world axes of the file to ours.
  DQuat world_turn = DQuat(1.0, 0.0, 0.0, 0.0);
  /// Rotation from the axes of the file's joint frames to the axes of ours.
  DQuat joint_turn = DQuat(1.0, 0.0, 0.0, 0.0);
};

/// Determines the axes of a figure. The up axis is `up` if it is set. Otherwise it is the up axis
/// of a rest pose that stands, or else the mean direction from the feet to the hips over the
/// motion. If both differ, the rest pose decides unless the figure clearly stands and moves along
/// the other axis. If joint names do not contain the sides of the legs, determines the sides from
/// the direction of the feet, and swaps the legs of `figure` if necessary. Adds notes to `figure`.
///
/// Errors: kUnsupported if left and right cannot be determined.
[[nodiscard]] Expected<FigureAxes> FindFigureAxes(BvhFigure& figure, std::optional<BvhAxis> up,
                                                  const std::string& name);

}  // namespace stridewire
