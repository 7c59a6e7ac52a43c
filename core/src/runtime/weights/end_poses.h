#pragma once

#include <array>
#include <span>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Computes the parameters of a blend from its first and last pose, and their derivatives by the
/// weights. That is all that weight correction needs. It evaluates only the chains of joints from
/// the root to the balls of the feet, with the base frame at the origin. Never allocates. Same
/// bytes on every machine.
class EndPoses {
 public:
  EndPoses(const Skeleton& skeleton, const GridLayout& layout, const MotionGroup& group);

  /// Blends both poses with the weights and the heading change of a movement (see ApplyWeights).
  void Blend(const Movement& movement);

  /// The parameters of the blend, as MeasureMovement returns them.
  [[nodiscard]] ParameterValues Measure() const;

  /// Writes J = a'(w), the derivatives of the parameters by each weight at the last blend, to
  /// `slopes` [d][n], in metres or radians. Individual derivatives also change the sum of the
  /// weights, so only combinations that keep the sum are meaningful.
  void MeasureSlopes(std::span<double> slopes) const;

 private:
  // A joint of a chain.
  struct Link {
    DQuat rotation;
    // 1 / |Q|, where Q is the weighted sum whose direction is `rotation`. 0 if the rotation is that
    // of a single example.
    double per_norm;
    DVec3 arm;   // Vector from the joint to the ball, in the joint's axes.
    DVec3 ball;  // The same vector in the axes of the parent.
  };
  struct End {
    std::array<std::array<Link, kMaxJoints>, 2> links;  // [foot], in the order of chains_.
    DVec3 root_m;
    double sine = 0.0;  // Sine and cosine of the root's yaw.
    double cosine = 1.0;
    std::array<DVec3, 2> arms_m;  // [foot]: from the root to the ball, in the base frame.
    [[nodiscard]] DVec3 Ball(std::size_t foot) const { return root_m + arms_m[foot]; }
  };
  // Derivative of a measurement by the numbers in an example's row.
  class Gradient;

  void BlendEnd(const Movement& movement, bool is_end);
  void AddGradient(const End& end, std::size_t foot, const DVec3& along, Gradient& gradient) const;
  [[nodiscard]] const float* Rows(bool is_end) const;

  const Skeleton& skeleton_;
  const GridLayout& layout_;
  const MotionGroup& group_;
  std::array<std::array<int, kMaxJoints>, 2> chains_;  // [foot]: from the ball's joint to the root.
  std::array<std::size_t, 2> lengths_{};               // [foot]: length of each chain.
  double sign_;  // +1 if "left minus right" is "moving minus fixed", else -1.
  double heading_change_rad_ = 0.0;
  double sine_ = 0.0;  // Sine and cosine of heading_change_rad_.
  double cosine_ = 1.0;
  std::array<End, 2> ends_;  // First pose, last pose.
};

}  // namespace stridewire
