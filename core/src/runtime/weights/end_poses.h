#pragma once

#include <array>
#include <span>
#include <vector>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Computes the parameters of a blend from its first and last pose, and their derivatives with
/// respect to the weights, for weight correction. Evaluates only the chains of joints from the root
/// to the balls of the feet, with the base frame at the origin. Allocates only in its constructor.
/// The results have the same bits on every machine.
class EndPoses {
 public:
  /// Borrows `skeleton`.
  EndPoses(const Skeleton& skeleton, const GridLayout& layout);

  /// Selects the group to measure. Borrows it until the next call.
  void SetGroup(const MotionGroup& group);

  [[nodiscard]] const GridLayout& layout() const { return layout_; }

  /// Blends both poses with the weights and the heading change of a movement (see ApplyWeights).
  void Blend(const Movement& movement);

  /// Returns the parameters of the blend, as MeasureMovement does.
  [[nodiscard]] ParameterValues Measure() const;

  /// Writes J = a'(w), the derivatives of the parameters with respect to each weight, to `slopes`
  /// [d][n], in metres or radians. They are those for the weights of the last Blend. A change of a
  /// single weight also changes the sum of the weights, so only combinations that keep the sum are
  /// meaningful.
  void MeasureSlopes(std::span<double> slopes);

 private:
  // A joint of a chain.
  struct Link {
    DQuat rotation;
    // 1 / |Q|, where Q is the weighted sum of the examples' quaternions. 0 if Q is so short that
    // the rotation of a single example is used instead.
    double per_norm;
    DVec3 arm;   // Vector from the joint to the ball, in the joint's axes.
    DVec3 ball;  // Vector from the joint to the ball, in the axes of the parent.
  };
  struct End {
    std::array<std::vector<Link>, 2> links;  // [foot]: links in the order of chains_.
    DVec3 root_m;
    double sine = 0.0;  // Sine and cosine of the root's yaw.
    double cosine = 1.0;
    std::array<DVec3, 2> arms_m;  // [foot]: vector from the root to the ball, in the base frame.
    [[nodiscard]] DVec3 Ball(std::size_t foot) const { return root_m + arms_m[foot]; }
  };
  // Derivative of a measurement with respect to the numbers in a blended row.
  class Gradient {
   public:
    void Clear() { joint_count_ = 0; }
    void SetCapacity(std::size_t joint_count) { joints_.resize(joint_count); }
    // Adds the derivative with respect to the four components of a joint's quaternion. The joint
    // index after the last one stands for the root's position and yaw.
    void Add(int joint, const DVec3& by_xyz, double by_w);
    // Adds the derivative with respect to the weight of each example to `slopes` [n]: the product
    // of this gradient and the example's row. `rows` [n][row_floats] are the rows of the examples.
    void AddTo(const float* rows, std::size_t row_floats, std::span<double> slopes) const;

   private:
    struct Parts {
      std::size_t joint;
      std::array<double, 4> by;
    };
    std::size_t joint_count_ = 0;
    std::vector<Parts> joints_;  // Only the first joint_count_ elements are in use.
  };

  void BlendEnd(const Movement& movement, bool is_end);
  void AddGradient(const End& end, std::size_t foot, const DVec3& along, Gradient& gradient) const;
  [[nodiscard]] const float* Rows(bool is_end) const;

  const Skeleton& skeleton_;
  GridLayout layout_;
  const MotionGroup* group_ = nullptr;
  // [foot]: joints from the joint of the ball to the root.
  std::array<std::vector<int>, 2> chains_;
  double sign_ = 1.0;  // -1 if the right foot is the moving foot, and +1 otherwise.
  double heading_change_rad_ = 0.0;
  double sine_ = 0.0;  // Sine and cosine of heading_change_rad_.
  double cosine_ = 1.0;
  std::array<End, 2> ends_;  // The first and the last pose.
  Gradient gradient_;        // Scratch memory of MeasureSlopes.
};

}  // namespace stridewire
