#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Up to kLanes poses side by side, one per lane, in the layout that the SIMD kernels use.
class SoaPose {
 public:
  static constexpr std::size_t kLanes = 16;

  explicit SoaPose(int joint_count) : numbers_(3 + 4 * static_cast<std::size_t>(joint_count)) {}

  [[nodiscard]] std::size_t joint_count() const { return (numbers_.size() - 3) / 4; }
  /// [x y z][kLanes]: positions of the roots in world space.
  [[nodiscard]] float* roots_m() { return numbers_[0].of; }
  [[nodiscard]] const float* roots_m() const { return numbers_[0].of; }
  /// [joint][x y z w][kLanes].
  [[nodiscard]] float* rotations() { return numbers_[0].of + 3 * kLanes; }
  [[nodiscard]] const float* rotations() const { return numbers_[0].of + 3 * kLanes; }

  [[nodiscard]] Vec3 root_m(std::size_t lane) const {
    return {numbers_[0].of[lane], numbers_[1].of[lane], numbers_[2].of[lane]};
  }
  /// Copies the pose of one lane. `pose` has joint_count() rotations.
  void Get(std::size_t lane, PoseSpan pose) const;
  /// Copies the poses of the first lanes, one per element of `roots_m` and `rotations`.
  void GetFirst(std::span<Vec3* const> roots_m, std::span<Quat* const> rotations) const;
  void Set(std::size_t lane, ConstPoseSpan pose);

 private:
  // A group of floats that fills one cache line.
  struct alignas(64) Numbers {
    float of[kLanes] = {};
  };
  std::vector<Numbers> numbers_;
};

}  // namespace stridewire
