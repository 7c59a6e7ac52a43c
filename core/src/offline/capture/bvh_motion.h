#pragma once

#include <vector>

#include "offline/capture/bvh_file.h"
#include "offline/capture/leg_finder.h"
#include "stridewire/base/math.h"

namespace stridewire {

/// The local transforms of the joints of a BVH file, in the axes and the unit of the file.
/// Borrows the file.
class BvhMotion {
 public:
  explicit BvhMotion(const BvhFile& file);

  [[nodiscard]] DVec3 LocalPosition(int frame, int joint) const;
  [[nodiscard]] DQuat LocalRotation(int frame, int joint) const;

  /// Returns true if the joint has position channels that replace its OFFSET. If all positions of a
  /// joint below a root are zero, its OFFSET is kept.
  [[nodiscard]] bool HasPositions(int joint) const;

  /// Mean of LocalPosition over the frames from `first_frame`.
  [[nodiscard]] DVec3 MeanPosition(int joint, int first_frame) const;
  /// Largest distance of LocalPosition from `mean` over the frames from `first_frame`.
  [[nodiscard]] double Deviation(int joint, int first_frame, const DVec3& mean) const;

  /// Returns the shape of the joints from `begin` to `end`, which belong to one root, numbered from
  /// 0. Joints with positions have their mean as offset.
  [[nodiscard]] FigureShape ShapeOf(int begin, int end, int sampled_frames) const;

 private:
  [[nodiscard]] double ValueAt(int frame, int channel) const;

  const BvhFile& file_;
  std::vector<bool> has_positions_;
};

}  // namespace stridewire
