#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "offline/capture/bvh_file.h"
#include "stridewire/base/math.h"

namespace stridewire::test {

/// World positions of the joints of a BVH file in its own axes and unit. Computed without the
/// conversions of ReadBvh, so that tests can compare files independently of them.
class BvhPositions {
 public:
  /// Throws std::runtime_error if the text is not BVH.
  explicit BvhPositions(std::string_view text);

  [[nodiscard]] int frame_count() const { return file_.frame_count; }
  [[nodiscard]] double frame_time_s() const { return file_.frame_time_s; }
  [[nodiscard]] const std::vector<BvhJoint>& joints() const { return file_.joints; }
  /// Index of the joint with this name, or -1.
  [[nodiscard]] int Find(std::string_view name) const;
  /// Positions of all joints in one frame.
  [[nodiscard]] std::vector<DVec3> At(int frame) const;

 private:
  BvhFile file_;
};

}  // namespace stridewire::test
