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

  /// Mean of LocalPosition over all frames from `first_frame` on.
  [[nodiscard]] DVec3 MeanPosition(int joint, int first_frame) const;
  /// Largest distance of LocalPosition from `mean` in all frames from `first_frame` on.
  [[nodiscard]] double Deviation(int joint, int first_frame, const DVec3& mean) const;

  /// Returns the shape of the joints in [begin, end), which belong to one root. The result numbers
  /// them from 0. The offset of a joint with position channels is the mean of its positions. At
  /// least `sampled_frames` poses are sampled, or every frame if there are fewer.
  [[nodiscard]] FigureShape ShapeOf(int begin, int end, int sampled_frames) const;

 private:
  [[nodiscard]] double ValueAt(int frame, int channel) const;

  const BvhFile& file_;
  std::vector<bool> has_positions_;
};

}  // namespace stridewire
