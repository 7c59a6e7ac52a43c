#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Measures both legs of a pose: in which direction the knees bend, how close the legs are to each
/// other, and where the soles are. Works for any skeleton. The soles are defined by the stand pose,
/// in which they are on the ground.
class LegGeometry {
 public:
  LegGeometry(const Skeleton& skeleton, ConstPoseSpan stand)
      : skeleton_(skeleton),
        positions_(static_cast<std::size_t>(skeleton.joint_count())),
        rotations_(static_cast<std::size_t>(skeleton.joint_count())) {
    Set(stand);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const Leg& leg = skeleton.leg(foot);
      const DVec3 ball = At(leg.ball, leg.ball_offset_m);
      const DVec3 tip = At(leg.ball, leg.toe_tip_offset_m);
      DVec3 heel = At(leg.ankle) - 0.06 * Forward(foot);
      heel.y = ball.y;
      const auto f = static_cast<std::size_t>(foot);
      heel_offsets_[f] = glm::conjugate(rotations_[Index(leg.ankle)]) * (heel - At(leg.ankle));
      resting_[f] = {heel.y, ball.y, tip.y};
    }
  }

  void Set(ConstPoseSpan pose) {
    std::vector<Vec3> positions(positions_.size());
    std::vector<Quat> rotations(rotations_.size());
    ForwardKinematics(skeleton_, pose, positions, rotations);
    for (std::size_t j = 0; j < positions.size(); ++j) {
      positions_[j] = DVec3(positions[j]);
      rotations_[j] = DQuat(rotations[j]);
    }
  }

  /// Positions of heel, ball and tip of the toes.
  [[nodiscard]] std::array<DVec3, 3> Sole(Foot foot) const {
    const Leg& leg = skeleton_.leg(foot);
    return {At(leg.ankle) +
                rotations_[Index(leg.ankle)] * heel_offsets_[static_cast<std::size_t>(foot)],
            At(leg.ball, leg.ball_offset_m), At(leg.ball, leg.toe_tip_offset_m)};
  }
  /// Heights of heel, ball and tip of the toes in the stand pose.
  [[nodiscard]] const std::array<double, 3>& RestingHeights(Foot foot) const {
    return resting_[static_cast<std::size_t>(foot)];
  }

  /// Flexion of the ankle in degrees: 0 if the shank is perpendicular to the sole, and positive if
  /// the toes are up.
  [[nodiscard]] double AnkleDegrees(Foot foot) const {
    const Leg& leg = skeleton_.leg(foot);
    const DVec3 shank = glm::normalize(At(leg.knee) - At(leg.ankle));
    // The heel and the ball are equally high in the stand pose.
    const std::array<DVec3, 3> sole = Sole(foot);
    return std::asin(glm::dot(shank, glm::normalize(sole[1] - sole[0]))) * 180.0 / M_PI;
  }

  /// Angle between thigh and shank in degrees: 0 is straight, negative means bent backward.
  [[nodiscard]] double KneeDegrees(Foot foot) const {
    const Leg& leg = skeleton_.leg(foot);
    const DVec3 thigh = glm::normalize(At(leg.knee) - At(leg.hip));
    const DVec3 shank = glm::normalize(At(leg.ankle) - At(leg.knee));
    const double angle = std::acos(std::clamp(glm::dot(thigh, shank), -1.0, 1.0)) * 180.0 / M_PI;
    const DVec3 line = glm::normalize(At(leg.ankle) - At(leg.hip));
    const DVec3 out =
        At(leg.knee) - At(leg.hip) - glm::dot(At(leg.knee) - At(leg.hip), line) * line;
    // Use the heading of the pelvis, because a foot that hangs toes down may point anywhere.
    const DVec3 across = At(skeleton_.leg(Foot::kLeft).hip) - At(skeleton_.leg(Foot::kRight).hip);
    const DVec3 ahead = glm::cross(across, DVec3(0.0, 1.0, 0.0));
    return glm::dot(out, ahead) < 0.0 ? -angle : angle;
  }

  /// Smallest distance in metres between a shank or foot of one leg and the other leg.
  [[nodiscard]] double LegDistance() const {
    double least = 1e9;
    for (const auto& a : Segments(Foot::kLeft)) {
      for (const auto& b : Segments(Foot::kRight)) least = std::min(least, Distance(a, b));
    }
    return least;
  }

 private:
  using Segment = std::array<DVec3, 2>;

  static std::size_t Index(int joint) { return static_cast<std::size_t>(joint); }
  [[nodiscard]] DVec3 At(int joint, const Vec3& offset = Vec3(0.0f)) const {
    return positions_[Index(joint)] + rotations_[Index(joint)] * DVec3(offset);
  }
  [[nodiscard]] DVec3 Forward(Foot foot) const {
    const Leg& leg = skeleton_.leg(foot);
    DVec3 ahead = At(leg.ball, leg.ball_offset_m) - At(leg.ankle);
    ahead.y = 0.0;
    return glm::normalize(ahead);
  }
  [[nodiscard]] std::array<Segment, 2> Segments(Foot foot) const {
    const Leg& leg = skeleton_.leg(foot);
    const auto sole = Sole(foot);
    return {Segment{At(leg.knee), At(leg.ankle)}, Segment{sole[0], sole[2]}};
  }
  static double Distance(const Segment& a, const Segment& b) {
    double least = 1e9;
    for (int i = 0; i <= 16; ++i) {
      const DVec3 p = a[0] + (i / 16.0) * (a[1] - a[0]);
      const DVec3 along = b[1] - b[0];
      const double s = std::clamp(glm::dot(p - b[0], along) / glm::dot(along, along), 0.0, 1.0);
      least = std::min(least, glm::length(p - b[0] - s * along));
    }
    return least;
  }

  const Skeleton& skeleton_;
  std::vector<DVec3> positions_;
  std::vector<DQuat> rotations_;
  std::array<DVec3, 2> heel_offsets_;
  std::array<std::array<double, 3>, 2> resting_{};
};

}  // namespace stridewire
