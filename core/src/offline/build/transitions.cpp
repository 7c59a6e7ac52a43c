#include "offline/build/transitions.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/build/grid_example.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/library/transition.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

// Positions and velocities of the joints, relative to the ground below the root and the heading.
struct Moment {
  int example = -1;
  std::vector<DVec3> joints_m;
  std::vector<DVec3> velocities_m_s;
};

// Returns the root mean square of the distances. If it is above `limit_m`, may return any value
// above that limit.
double RootMeanSquareM(const std::vector<DVec3>& a, const std::vector<DVec3>& b, double limit_m) {
  const double limit = limit_m * limit_m * static_cast<double>(a.size()) * (1.0 + 1e-9);
  double sum = 0.0;
  for (std::size_t j = 0; j < a.size() && !(sum > limit); ++j) {
    sum += glm::dot(a[j] - b[j], a[j] - b[j]);
  }
  return std::sqrt(sum / static_cast<double>(a.size()));
}

class MomentReader {
 public:
  explicit MomentReader(const Skeleton& skeleton)
      : skeleton_(skeleton),
        layout_(skeleton.joint_count()),
        points_(skeleton.joints.size()),
        rotations_(skeleton.joints.size()) {}

  Moment Stand(const Pose& pose) {
    const std::vector<DVec3> joints_m = PointsOf(pose);
    return {-1, RelativeTo(joints_m, joints_m[0], 0.0, 0.0), std::vector<DVec3>(joints_m.size())};
  }

  Moment Start(const MotionGroup& group, int example) {
    const auto keytimes_s = KeytimesOf(group, example);
    return MomentOf(group, example,
                    {.point = 0,
                     .neighbour = 1,
                     .to_neighbour_s = (keytimes_s[1] - keytimes_s[0]) / group.cells.front()});
  }

  Moment End(const MotionGroup& group, int example) {
    const auto keytimes_s = KeytimesOf(group, example);
    const auto last = static_cast<std::size_t>(group.interval_count());
    const int rise =
        group.FindParameter(IsStep(group.kind) ? ParameterName::kEndY : ParameterName::kHeight);
    const auto e = static_cast<std::size_t>(example);
    const std::span<const double> site = group.site(example);
    return MomentOf(
        group, example,
        {.point = group.grid_point_count - 1,
         .neighbour = group.grid_point_count - 2,
         .to_neighbour_s = -(keytimes_s[last] - keytimes_s[last - 1]) / group.cells.back(),
         .heading_rad = group.heading_change_rad[e],
         .ground_m = rise < 0 ? 0.0 : GroundRise(site[static_cast<std::size_t>(rise)])});
  }

 private:
  static std::span<const double> KeytimesOf(const MotionGroup& group, int example) {
    const auto keys = static_cast<std::size_t>(group.interval_count()) + 1;
    return group.keytimes_s.subspan(static_cast<std::size_t>(example) * keys, keys);
  }

  // The first or last grid point of an example, and its neighbour, from which velocities are
  // computed.
  struct GridEnd {
    int point = 0;
    int neighbour = 0;
    // Time from this point to the neighbour. Negative if the neighbour is earlier.
    double to_neighbour_s = 0.0;
    double heading_rad = 0.0;
    double ground_m = 0.0;
  };

  Moment MomentOf(const MotionGroup& group, int example, const GridEnd& end) {
    STRIDEWIRE_CHECK(end.point >= 0 && end.point < group.grid_point_count);
    STRIDEWIRE_CHECK(end.to_neighbour_s != 0.0);
    const std::vector<DVec3> at = PointsOf(group, example, end.point);
    const std::vector<DVec3> next = PointsOf(group, example, end.neighbour);
    const DVec3 root_m = at[0];
    Moment moment{example, RelativeTo(at, root_m, end.heading_rad, end.ground_m),
                  RelativeTo(next, root_m, end.heading_rad, end.ground_m)};
    for (std::size_t j = 0; j < at.size(); ++j) {
      moment.velocities_m_s[j] =
          (moment.velocities_m_s[j] - moment.joints_m[j]) / end.to_neighbour_s;
    }
    return moment;
  }

  static std::vector<DVec3> RelativeTo(std::vector<DVec3> points, const DVec3& root_m,
                                       double heading_rad, double ground_m) {
    for (DVec3& point : points) {
      point = RotateYaw(-heading_rad, point - DVec3(root_m.x, ground_m, root_m.z));
    }
    return points;
  }

  std::vector<DVec3> PointsOf(const MotionGroup& group, int example, int point) {
    const auto n = static_cast<std::size_t>(group.row_count());
    const std::size_t row = static_cast<std::size_t>(point) * n + static_cast<std::size_t>(example);
    const auto row_floats = static_cast<std::size_t>(layout_.row_floats);
    return PointsOf(PoseOfRow(group.grid.subspan(row * row_floats, row_floats), layout_,
                              skeleton_.joint_count()));
  }

  std::vector<DVec3> PointsOf(ConstPoseSpan pose) {
    ForwardKinematics(skeleton_, pose, points_, rotations_);
    return {points_.begin(), points_.end()};
  }

  const Skeleton& skeleton_;
  GridLayout layout_;
  std::vector<Vec3> points_;
  std::vector<Quat> rotations_;
};

Transition Nearest(const std::vector<Moment>& ends, const std::vector<Moment>& starts) {
  STRIDEWIRE_CHECK(!ends.empty() && !starts.empty());
  Transition nearest;
  double least_m = HUGE_VAL;
  for (const Moment& end : ends) {
    for (const Moment& start : starts) {
      double distance_m = RootMeanSquareM(end.joints_m, start.joints_m, least_m);
      if (distance_m >= least_m) continue;
      distance_m +=
          kTransitionVelocityS * RootMeanSquareM(end.velocities_m_s, start.velocities_m_s,
                                                 (least_m - distance_m) / kTransitionVelocityS);
      if (distance_m >= least_m) continue;
      least_m = distance_m;
      nearest = {static_cast<float>(distance_m), end.example, start.example};
    }
  }
  return nearest;
}

}  // namespace

std::vector<Transition> FindTransitions(const LibraryContent& content) {
  MomentReader reader(content.skeleton);
  std::vector<std::vector<Moment>> ends;
  std::vector<std::vector<Moment>> starts;
  for (const MotionGroup& group : content.groups) {
    ends.emplace_back();
    starts.emplace_back();
    const int compared = std::min(group.example_count, kMaxComparedExamples);
    for (int i = 0; i < compared; ++i) {
      const int example = i * group.example_count / compared;
      ends.back().push_back(reader.End(group, example));
      starts.back().push_back(reader.Start(group, example));
    }
  }
  ends.push_back({reader.Stand(content.stand_pose)});
  starts.push_back(ends.back());
  std::vector<Transition> transitions;
  for (const auto& end : ends) {
    for (const auto& start : starts) transitions.push_back(Nearest(end, start));
  }
  return transitions;
}

}  // namespace stridewire
