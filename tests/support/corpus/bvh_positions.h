#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/math.h"

namespace stridewire::test {

/// World positions of the joints of a BVH file in its own axes and unit. Reads plain files only,
/// with one ROOT and one line per frame. Independent of ReadBvh and its conversions.
class BvhPositions {
 public:
  /// Throws std::runtime_error if the text is not plain BVH.
  explicit BvhPositions(std::string_view text);

  [[nodiscard]] int frame_count() const { return static_cast<int>(frames_.size()); }
  [[nodiscard]] int joint_count() const { return static_cast<int>(joints_.size()); }
  [[nodiscard]] double frame_time_s() const { return frame_time_s_; }
  [[nodiscard]] const std::string& Name(int joint) const {
    return joints_[static_cast<std::size_t>(joint)].name;
  }
  /// Index of the joint with this name, or -1.
  [[nodiscard]] int Find(std::string_view name) const;
  /// Positions of all joints in one frame.
  [[nodiscard]] std::vector<DVec3> At(int frame) const;
  /// Position of the joint with this name; throws std::runtime_error if there is none.
  [[nodiscard]] DVec3 At(int frame, std::string_view name) const;

 private:
  struct Joint {
    std::string name;
    int parent = -1;
    DVec3 offset = DVec3(0.0);
    std::vector<std::string> channels;  // "Xposition", "Zrotation", ...
  };

  std::vector<Joint> joints_;
  double frame_time_s_ = 0.0;
  std::vector<std::vector<double>> frames_;  // One value per channel.
};

}  // namespace stridewire::test
