#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "runtime/library/keytimes.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"

namespace stridewire {

/// Change of velocities from one frame to the next.
struct VelocityStep {
  double joint_rad_s = 0.0;  ///< Largest change of the angular velocity vector of a joint.
  double root_m_s = 0.0;
};

/// Measures changes of velocity frame by frame. Hands, fingers and thumbs are ignored: in captures,
/// fingers twitch by up to 186 rad/s, and a bound that allows this would not detect faults of other
/// joints.
class VelocitySteps {
 public:
  VelocitySteps(const Skeleton& skeleton, double fps)
      : fps_(fps),
        last_(skeleton.joint_count()),
        velocity_(static_cast<std::size_t>(skeleton.joint_count())) {
    for (const Joint& joint : skeleton.joints) {
      is_watched_.push_back(!joint.name.contains("Thumb") && !joint.name.contains("Finger") &&
                            !joint.name.contains("Hand"));
    }
  }

  /// Adds a pose and returns the change of velocity at the previous frame. Returns zero for the
  /// first two poses.
  VelocityStep Add(ConstPoseSpan pose) {
    VelocityStep step;
    for (std::size_t j = 0; j < velocity_.size(); ++j) {
      if (!is_watched_[j]) continue;
      const DVec3 velocity = VelocityBetween(DQuat(last_.rotations[j]), DQuat(pose.rotations[j]));
      step.joint_rad_s = std::max(step.joint_rad_s, glm::length(velocity - velocity_[j]));
      velocity_[j] = velocity;
      last_.rotations[j] = pose.rotations[j];
    }
    const DVec3 root_velocity = fps_ * DVec3(pose.root_position_m - last_.root_position_m);
    step.root_m_s = glm::length(root_velocity - root_velocity_);
    root_velocity_ = root_velocity;
    last_.root_position_m = pose.root_position_m;
    return ++frames_ > 2 ? step : VelocityStep{};
  }

 private:
  [[nodiscard]] DVec3 VelocityBetween(const DQuat& before, const DQuat& after) const {
    const DQuat turn = glm::conjugate(before) * after;
    const double sine = std::sqrt(turn.x * turn.x + turn.y * turn.y + turn.z * turn.z);
    if (sine <= 1e-12) return DVec3(0.0);
    const double angle = 2.0 * std::atan2(sine, std::fabs(turn.w));
    return (turn.w < 0.0 ? -1.0 : 1.0) * angle / sine * fps_ * DVec3(turn.x, turn.y, turn.z);
  }

  double fps_;
  std::vector<char> is_watched_;
  Pose last_;
  std::vector<DVec3> velocity_;
  DVec3 root_velocity_ = DVec3(0.0);
  int frames_ = 0;
};

/// Largest change of velocity inside the examples of one kind.
inline VelocityStep LargestStepOfExamples(const MotionLibrary& library, double fps,
                                          MovementKind kind) {
  VelocityStep largest;
  GridCache cache(library.layout());
  Pose pose(library.skeleton().joint_count());
  for (int g = 0; g < static_cast<int>(library.groups().size()); ++g) {
    const MotionGroup& group = library.group(g);
    if (group.kind != kind) continue;
    std::vector<double> scratch(static_cast<std::size_t>(group.example_count));
    for (int e = 0; e < group.example_count; ++e) {
      Movement movement;
      const std::vector<double> centre(group.parameters.size());
      StartMovement(group, g, centre, BaseFrame{}, scratch, movement);
      std::ranges::fill(movement.weights, 0.0f);
      movement.weights[static_cast<std::size_t>(e)] = 1.0f;
      const auto n = static_cast<std::size_t>(group.interval_count()) + 1;
      movement.warp =
          TimeWarp(group.keytimes_s.subspan(static_cast<std::size_t>(e) * n, n), group.cells);
      cache.Clear();
      VelocitySteps steps(library.skeleton(), fps);
      for (double t = 0.0; t < movement.duration_s(); t += 1.0 / fps) {
        EvaluateBlend(group, library.layout(), movement, t, cache, pose);
        const VelocityStep step = steps.Add(pose);
        largest.joint_rad_s = std::max(largest.joint_rad_s, step.joint_rad_s);
        largest.root_m_s = std::max(largest.root_m_s, step.root_m_s);
      }
    }
  }
  return largest;
}

/// Largest change of velocity inside the examples of all steps.
inline VelocityStep LargestStepOfExamples(const MotionLibrary& library, double fps) {
  const VelocityStep left = LargestStepOfExamples(library, fps, MovementKind::kStepLeft);
  const VelocityStep right = LargestStepOfExamples(library, fps, MovementKind::kStepRight);
  return {std::max(left.joint_rad_s, right.joint_rad_s), std::max(left.root_m_s, right.root_m_s)};
}

}  // namespace stridewire
