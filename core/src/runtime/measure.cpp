#include "stridewire/runtime/measure.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stridewire/runtime/foot_vector.h"

namespace stridewire {
namespace {

constexpr double kSmallestBlendNorm = 0.1;  // below it GridCache blends nothing

struct Feet {
  DVec3 left;
  DVec3 right;
  [[nodiscard]] DVec3 Centre() const { return 0.5 * (left + right); }
};

Feet FeetOf(const Skeleton& skeleton, ConstPoseSpan pose) {
  return {DVec3(BallPosition(skeleton, pose, Foot::kLeft)),
          DVec3(BallPosition(skeleton, pose, Foot::kRight))};
}

// An example's unit quaternion of a joint, x, y, z, w.
using QuatParts = std::array<double, 4>;

// How a foot's ball moves with the weights in one pose: by each joint of its chain, by the root's yaw and its place.
class BallSlopes {
 public:
  BallSlopes(const Skeleton& skeleton, const GridLayout& layout, const MotionGroup& group,
             std::span<const double> weights, int point, Foot foot)
      : padded_(static_cast<std::size_t>(layout.padded_joints)),
        root_(static_cast<std::size_t>(layout.root())),
        row_floats_(static_cast<std::size_t>(layout.row_floats)),
        rows_(group.grid.subspan(static_cast<std::size_t>(point) * weights.size() * row_floats_,
                                 weights.size() * row_floats_)) {
    const Leg& leg = skeleton.leg(foot);
    double yaw_rad = 0.0;
    for (std::size_t e = 0; e < weights.size(); ++e) yaw_rad += weights[e] * Row(e)[root_ + 3];
    const DVec3 right = RotateYaw(yaw_rad, DVec3(1.0, 0.0, 0.0));
    const DVec3 ahead = RotateYaw(yaw_rad, DVec3(0.0, 0.0, 1.0));
    const auto turned = [&](const DVec3& v) {
      return v.x * right + DVec3(0.0, v.y, 0.0) + v.z * ahead;
    };

    for (int j = leg.ball; j >= 0; j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
      links_[count_++].joint = static_cast<std::size_t>(j);
    }
    // From the root down, before it is turned: where joints are, and how they are turned.
    DVec3 place(0.0);
    for (std::size_t i = count_; i-- > 0;) {
      Link& link = links_[i];
      QuatParts blended{};
      for (std::size_t e = 0; e < weights.size(); ++e) {
        const QuatParts parts = PartsOf(e, link.joint);
        for (std::size_t c = 0; c < 4; ++c) blended[c] += weights[e] * parts[c];
      }
      const double norm = std::sqrt(blended[0] * blended[0] + blended[1] * blended[1] +
                                    blended[2] * blended[2] + blended[3] * blended[3]);
      // Rotations that have no mean change as nothing says.
      link.per_norm = norm >= kSmallestBlendNorm ? 1.0 / norm : 0.0;
      link.local =
          DQuat(blended[3] / norm, blended[0] / norm, blended[1] / norm, blended[2] / norm);
      if (link.per_norm == 0.0) link.local = DQuat(1.0, 0.0, 0.0, 0.0);
      if (i + 1 < count_) {
        place += links_[i + 1].world * DVec3(skeleton.joints[link.joint].offset_m);
        link.world = links_[i + 1].world * link.local;
      } else {
        link.world = link.local;
      }
      link.place = place;
    }
    const DVec3 ball = place + links_[0].world * DVec3(leg.ball_offset_m);
    ball_ = turned(ball);
    for (std::size_t i = 0; i < count_; ++i) {
      Link& link = links_[i];
      const DVec3 axis(link.local.x, link.local.y, link.local.z);
      for (std::size_t c = 0; c < 4; ++c) {
        // The rotation vector of q* x / |Q|, x the unit vector along c.
        const DVec3 x(c == 0 ? 1.0 : 0.0, c == 1 ? 1.0 : 0.0, c == 2 ? 1.0 : 0.0);
        const DVec3 omega =
            2.0 * link.per_norm * (c == 3 ? -axis : link.local.w * x - glm::cross(axis, x));
        link.moves[c] = turned(glm::cross(link.world * omega, ball - link.place));
      }
    }
  }

  // From the root's place.
  [[nodiscard]] const DVec3& ball() const { return ball_; }

  [[nodiscard]] DVec3 Of(std::size_t example) const {
    const float* row = Row(example);
    const double yaw_rad = row[root_ + 3];
    DVec3 moved =
        DVec3(row[root_], row[root_ + 1], row[root_ + 2]) + yaw_rad * DVec3(ball_.z, 0.0, -ball_.x);
    for (std::size_t i = 0; i < count_; ++i) {
      const QuatParts parts = PartsOf(example, links_[i].joint);
      for (std::size_t c = 0; c < 4; ++c) moved += parts[c] * links_[i].moves[c];
    }
    return moved;
  }

 private:
  struct Link {
    std::size_t joint;
    double per_norm;
    DQuat local;
    DQuat world;
    DVec3 place;
    std::array<DVec3, 4> moves;  // of the ball by each part of the joint's blended quaternion
  };

  [[nodiscard]] const float* Row(std::size_t example) const {
    return &rows_[example * row_floats_];
  }
  [[nodiscard]] QuatParts PartsOf(std::size_t example, std::size_t joint) const {
    const float* row = Row(example) + joint;
    return {row[0], row[padded_], row[2 * padded_], row[3 * padded_]};
  }

  std::size_t padded_;
  std::size_t root_;
  std::size_t row_floats_;
  std::span<const float> rows_;  // [example][row_floats]
  DVec3 ball_;
  std::size_t count_ = 0;
  std::array<Link, kMaxJoints> links_;  // from the ball's joint to the root
};

}  // namespace

void MeasureSlopes(const Skeleton& skeleton, const GridLayout& layout, const MotionGroup& group,
                   std::span<const double> weights, std::span<double> slopes) {
  const std::size_t n = weights.size();
  double heading_rad = 0.0;
  for (std::size_t e = 0; e < n; ++e) heading_rad += weights[e] * group.heading_change_rad[e];
  const double sign = group.kind == MovementKind::kStepRight ? -1.0 : 1.0;
  for (const bool is_end : {false, true}) {
    const int point = is_end ? group.grid_point_count - 1 : 0;
    const BallSlopes left(skeleton, layout, group, weights, point, Foot::kLeft);
    const BallSlopes right(skeleton, layout, group, weights, point, Foot::kRight);
    const DVec3 apart = sign * RotateYaw(-heading_rad, left.ball() - right.ball());
    for (std::size_t e = 0; e < n; ++e) {
      const DVec3 moved[] = {left.Of(e), right.Of(e)};
      DVec3 vector = sign * (moved[0] - moved[1]);
      if (is_end) {
        vector = RotateYaw(-heading_rad, vector) -
                 group.heading_change_rad[e] * DVec3(apart.z, 0.0, -apart.x);
      }
      const DVec3 centre = (is_end ? 0.5 : -0.5) * (moved[0] + moved[1]);
      for (std::size_t l = 0; l < group.parameters.size(); ++l) {
        double& slope = slopes[l * n + e];
        switch (group.parameters[l].name) {
          case ParameterName::kStartX:
            if (!is_end) slope = vector.x;
            break;
          case ParameterName::kStartY:
            if (!is_end) slope = vector.y;
            break;
          case ParameterName::kStartZ:
            if (!is_end) slope = vector.z;
            break;
          case ParameterName::kEndX:
            if (is_end) slope = vector.x;
            break;
          case ParameterName::kEndY:
            if (is_end) slope = vector.y;
            break;
          case ParameterName::kEndZ:
            if (is_end) slope = vector.z;
            break;
          case ParameterName::kTurn: slope = group.heading_change_rad[e]; break;
          case ParameterName::kLength: slope = (is_end ? slope : 0.0) + centre.z; break;
          case ParameterName::kHeight: slope = (is_end ? slope : 0.0) + centre.y; break;
        }
      }
    }
  }
}

ParameterValues MeasureMovement(const MotionLibrary& library, const Movement& movement,
                                GridCache& cache, PoseSpan pose) {
  return MeasureMovement(library.skeleton(), library.layout(), library.group(movement.group),
                         movement, cache, pose);
}

ParameterValues MeasureMovement(const Skeleton& skeleton, const GridLayout& layout,
                                const MotionGroup& group, const Movement& movement,
                                GridCache& cache, PoseSpan pose) {
  EvaluateGridPoint(group, layout, movement, 0, cache, pose);
  const Feet before = FeetOf(skeleton, pose);
  EvaluateGridPoint(group, layout, movement, group.grid_point_count - 1, cache, pose);
  const Feet after = FeetOf(skeleton, pose);

  const double sign = group.kind == MovementKind::kStepRight ? -1.0 : 1.0;
  const double start_heading = movement.base.heading_rad;
  const double end_heading = start_heading + movement.heading_change_rad;
  const DVec3 start = sign * RotateYaw(-start_heading, before.left - before.right);
  const DVec3 end = sign * RotateYaw(-end_heading, after.left - after.right);
  const DVec3 travel = RotateYaw(-start_heading, after.Centre() - before.Centre());

  ParameterValues measured;
  measured.count = group.parameter_count();
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    double& value = measured.values[l];
    switch (group.parameters[l].name) {
      case ParameterName::kStartX: value = start.x; break;
      case ParameterName::kStartY: value = start.y; break;
      case ParameterName::kStartZ: value = start.z; break;
      case ParameterName::kEndX: value = end.x; break;
      case ParameterName::kEndY: value = end.y; break;
      case ParameterName::kEndZ: value = end.z; break;
      case ParameterName::kTurn: value = movement.heading_change_rad; break;
      case ParameterName::kLength: value = travel.z; break;
      case ParameterName::kHeight: value = travel.y; break;
    }
  }
  return measured;
}

double LargestDifference(const MotionGroup& group, const ParameterValues& a,
                         const ParameterValues& b) {
  double largest = 0.0;
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    const double unit = group.parameters[l].name == ParameterName::kTurn ? kMetresPerRadian : 1.0;
    largest = std::max(largest, unit * std::fabs(a.values[l] - b.values[l]));
  }
  return largest;
}

}  // namespace stridewire
