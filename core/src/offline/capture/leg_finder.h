#pragma once

#include <span>
#include <string>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// The joints of a figure with their positions in the rest pose and in frames of its motion. All of
/// them are in the axes and the unit of the file.
struct FigureShape {
  std::vector<Joint> joints;
  std::vector<DVec3> rest;                ///< Positions if all rotations are the identity.
  std::vector<std::vector<DVec3>> poses;  ///< Positions in sampled frames; may be empty.
};

/// Makes the shape of a figure without motion.
[[nodiscard]] FigureShape RestShape(std::vector<Joint> joints);

/// The joints of a leg, as detected from the names and the shape of a figure.
struct FoundLeg {
  int hip = -1;  ///< The joint at the upper end of the thigh.
  int knee = -1;
  int ankle = -1;
  int ball = -1;  ///< The toe joint; -1: there is none below the ankle.
};

struct FoundLegs {
  FoundLeg legs[2];  ///< The two legs, indexed by Foot.
  int root = 0;      ///< The lowest joint above both legs.
  /// True if the legs were detected by shape, not by joint names.
  bool by_shape = false;
  /// False if the legs were detected by shape and the joint names do not contain their sides. Left
  /// and right may then be swapped until FindFigureAxes determines them.
  bool sides_known = true;
};

/// Finds the other joints of both legs from their ankles, indexed by Foot. The knee and the hip are
/// joints with matching names, or else the joints that divide the chain above the ankle into two
/// long segments. A twist joint never bends the leg, so it does not end a segment. Returns false if
/// the ankles do not belong to two legs. In this case, sets `side`, if it is not null, to the index
/// of the leg that was not found.
[[nodiscard]] bool FindLegsAbove(const FigureShape& figure, const int (&ankles)[2], FoundLegs& legs,
                                 int* side = nullptr);

/// Detects both legs by joint names or, if these do not identify them, by shape. By shape, legs are
/// two chains that start at the same joint and have equal lengths (within 8 %). Their ends are
/// below the rest of the body, in the motion or otherwise in the rest pose. Of several pairs, the
/// function chooses the one nearest to the root. If several pairs are equally near, it chooses the
/// longest.
///
/// Errors: kUnsupported if a leg is missing, if there is no pair of legs, or if the figure has more
/// than two legs or walks on hands and feet.
[[nodiscard]] Expected<FoundLegs> FindLegs(const FigureShape& figure);

}  // namespace stridewire
