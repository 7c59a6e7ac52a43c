#pragma once

#include <array>
#include <span>

#include "stridewire/runtime/motion_library.h"
#include "runtime/movement/movement.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Where the balls of the feet are in the first and last pose of a group's blends, and how that changes with the
/// weights: all that correction looks at. Of a row only the chains of joints from the root to the balls are gone
/// through. Of a base at the origin. Never allocates. Same bytes on every machine.
class EndPoses {
 public:
  EndPoses(const Skeleton& skeleton, const GridLayout& layout, const MotionGroup& group);

  /// Blends both poses by the movement's weights and heading change (TakeWeights).
  void Blend(const Movement& movement);

  /// The blend's own parameters, as MeasureMovement has them.
  [[nodiscard]] ParameterValues Measure() const;

  /// J = a'(w): how the parameters change with each weight from what was blended last, into `slopes` [d][n], metres or
  /// radians a weight. Weights change without their sum here as well, so that only changes whose sum is 0 mean
  /// something.
  void MeasureSlopes(std::span<double> slopes) const;

 private:
  // A joint of a chain. `arm` is where the ball is from the joint in the joint's own axes, `ball` the same in its
  // parent's.
  struct Link {
    DQuat rotation;
    double
        per_norm;  // 1 / |Q|, Q the sum that the rotation is the unit quaternion of; 0: it is of no blend
    DVec3 arm;
    DVec3 ball;
  };
  struct End {
    std::array<std::array<Link, kMaxJoints>, 2> links;  // by foot, as `chains_`
    DVec3 root_m;
    double sine = 0.0;  // of the root's yaw
    double cosine = 1.0;
    std::array<DVec3, 2> arms_m;  // by foot: from the root to the ball, turned
    [[nodiscard]] DVec3 Ball(std::size_t foot) const { return root_m + arms_m[foot]; }
  };
  // A change of what is measured with each of some numbers of an example's row.
  class Gradient;

  void BlendEnd(const Movement& movement, bool is_end);
  void AddGradient(const End& end, std::size_t foot, const DVec3& along, Gradient& gradient) const;
  [[nodiscard]] const float* Rows(bool is_end) const;

  const Skeleton& skeleton_;
  const GridLayout& layout_;
  const MotionGroup& group_;
  std::array<std::array<int, kMaxJoints>, 2> chains_;  // by foot: from the ball's joint to the root
  std::array<std::size_t, 2> lengths_{};
  double sign_;  // from the foot that stands to the one that moves
  double heading_change_rad_ = 0.0;
  double sine_ = 0.0;  // of that
  double cosine_ = 1.0;
  std::array<End, 2> ends_;  // start, end
};

}  // namespace stridewire
