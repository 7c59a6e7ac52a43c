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
  BvhAxis up = BvhAxis::kPlusY;                  ///< The up axis of the file.
  UpSource up_source = UpSource::kOption;        ///< What determined `up`.
  bool rest_stands = false;                      ///< The rest pose stands upright.
  DQuat world_turn = DQuat(1.0, 0.0, 0.0, 0.0);  ///< Turns the world of the file.
  DQuat joint_turn = DQuat(1.0, 0.0, 0.0, 0.0);  ///< Turns the frames of the joints.
};

/// Determines the axes of a figure. The up axis is `up` if it is set. Otherwise it is the up axis
/// of a rest pose that stands, or else the mean direction from the feet to the hips over the
/// motion. If both differ, the rest pose decides unless the figure moves and stands like one whose
/// file has the other axis. Swaps the legs of `figure` if their sides are unknown and the feet say
/// so. Adds notes to `figure`.
///
/// Errors: kUnsupported if left and right cannot be determined.
[[nodiscard]] Expected<FigureAxes> FindFigureAxes(BvhFigure& figure, std::optional<BvhAxis> up,
                                                  const std::string& name);

}  // namespace stridewire
