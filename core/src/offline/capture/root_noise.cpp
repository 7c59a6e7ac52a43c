#include "offline/capture/root_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/trig.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

constexpr double kLeastRadPerS2 = 600.0;
constexpr double kLeastMPerS2 = 90.0;
constexpr double kPercentile = 0.9;
constexpr double kDeviationS = 0.016;  // Standard deviation of the Gaussian.
constexpr double kShortestM = 1e-4;
// A leg is never stretched beyond this fraction of its length.
constexpr double kLongestReach = 0.9999;

std::size_t Slot(int i) { return static_cast<std::size_t>(i); }

// Returns the quantile kPercentile of `values`, which it reorders.
double PercentileOf(std::vector<double>& values) {
  if (values.empty()) return 0.0;
  const auto rank =
      static_cast<std::ptrdiff_t>(kPercentile * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, values.begin() + rank);
  return values[Slot(static_cast<int>(rank))];
}

// Returns the small rotation from `a` to `b` as a rotation vector.
Vec3 SmallRotation(const Quat& a, const Quat& b) {
  const Quat turn = glm::conjugate(a) * b;
  return (turn.w < 0.0f ? -2.0f : 2.0f) * Vec3(turn.x, turn.y, turn.z);
}

// A Gaussian filter for a series of values, truncated at two standard deviations.
class GaussianMean {
 public:
  GaussianMean(double fps, int count) : count_(count) {
    const double deviation = kDeviationS * fps;
    for (int i = 0; i <= static_cast<int>(std::lround(2.0 * deviation)); ++i) {
      weights_.push_back(std::exp(-0.5 * (i / deviation) * (i / deviation)));
    }
  }

  [[nodiscard]] Quat At(const std::vector<Quat>& track, int frame) const {
    const Quat& centre = track[Slot(frame)];
    Quat sum(0.0f, 0.0f, 0.0f, 0.0f);
    ForEach(frame, [&](int f, double weight) {
      const Quat& q = track[Slot(f)];
      sum += q * static_cast<float>(Dot(q, centre) < 0.0f ? -weight : weight);
    });
    return Normalise(sum);
  }
  [[nodiscard]] Vec3 At(const std::vector<Vec3>& track, int frame) const {
    DVec3 sum(0.0);
    double total = 0.0;
    ForEach(frame, [&](int f, double weight) {
      sum += weight * DVec3(track[Slot(f)]);
      total += weight;
    });
    return Vec3(sum / total);
  }

 private:
  // Near the ends of the track, the window becomes shorter on both sides, so that it stays centred.
  template <typename Visit>
  void ForEach(int frame, const Visit& visit) const {
    const int reach = std::min({static_cast<int>(weights_.size()) - 1, frame, count_ - 1 - frame});
    for (int i = -reach; i <= reach; ++i) visit(frame + i, weights_[Slot(std::abs(i))]);
  }

  int count_;
  std::vector<double> weights_;  // [distance in frames]
};

// The world transforms of all joints in one frame.
struct WorldPose {
  explicit WorldPose(int joints) : positions(Slot(joints)), rotations(Slot(joints)) {}
  std::vector<Vec3> positions;
  std::vector<Quat> rotations;
};

// Returns the shortest rotation that maps the direction of `from` to that of `to`.
DQuat ShortestRotation(const DVec3& from, const DVec3& to) {
  const double scale = std::sqrt(glm::dot(from, from) * glm::dot(to, to));
  const DVec3 axis = glm::cross(from, to);
  const DQuat q(scale + glm::dot(from, to), axis.x, axis.y, axis.z);
  return glm::dot(q, q) > 1e-12 * scale * scale ? glm::normalize(q) : DQuat(1.0, 0.0, 0.0, 0.0);
}

// Rotates thigh and shank so that the leg reaches from `hip_m` to `ankle_m`. The knee bends in the
// plane of the leg in `before`, and the foot keeps its rotation in the world.
void PlaceAnkle(const Leg& leg, const WorldPose& before, const Vec3& ankle_m, const Vec3& hip_m,
                const Quat& parent, PoseSpan pose) {
  const DVec3 thigh(before.positions[Slot(leg.knee)] - before.positions[Slot(leg.hip)]);
  const DVec3 shank(before.positions[Slot(leg.ankle)] - before.positions[Slot(leg.knee)]);
  const DVec3 reach(ankle_m - hip_m);
  const double a = glm::length(thigh);
  const double b = glm::length(shank);
  const DVec3 normal = glm::cross(thigh, shank);
  const double bend = Atan2(glm::length(normal), glm::dot(thigh, shank));
  const double distance =
      std::clamp(glm::length(reach), std::abs(a - b) + kShortestM, kLongestReach * (a + b));
  const double cosine = (distance * distance - a * a - b * b) / (2.0 * a * b);
  const double half_rad =
      0.5 * (Atan2(std::sqrt(std::max(0.0, 1.0 - cosine * cosine)), cosine) - bend);
  DQuat knee_turn(1.0, 0.0, 0.0, 0.0);
  if (glm::length(normal) > kShortestM * a * b) {
    const DVec3 axis = Sin(half_rad) * glm::normalize(normal);
    knee_turn = DQuat(Cos(half_rad), axis.x, axis.y, axis.z);
  }
  const DQuat leg_turn = ShortestRotation(thigh + knee_turn * shank, reach);
  const Quat thigh_rotation(leg_turn * DQuat(before.rotations[Slot(leg.hip)]));
  const Quat shank_rotation(leg_turn * knee_turn * DQuat(before.rotations[Slot(leg.knee)]));
  pose.rotations[Slot(leg.hip)] = Normalise(glm::conjugate(parent) * thigh_rotation);
  pose.rotations[Slot(leg.knee)] = Normalise(glm::conjugate(thigh_rotation) * shank_rotation);
  pose.rotations[Slot(leg.ankle)] =
      Normalise(glm::conjugate(shank_rotation) * before.rotations[Slot(leg.ankle)]);
}

bool IsPlainLeg(const Skeleton& skeleton, const Leg& leg) {
  return skeleton.joints[Slot(leg.knee)].parent == leg.hip &&
         skeleton.joints[Slot(leg.ankle)].parent == leg.knee;
}

// Returns the joints on the path from the root to a hip, without the root but with the hip.
std::vector<int> JointsToHip(const Skeleton& skeleton, int hip) {
  std::vector<int> joints;
  for (int j = hip; j > 0; j = skeleton.joints[Slot(j)].parent) joints.push_back(j);
  std::ranges::reverse(joints);
  return joints;
}

}  // namespace

bool RemoveRootNoise(const Skeleton& skeleton, int first_frame, Clip& clip) {
  const int count = clip.frame_count() - first_frame;
  if (count < 3 || !std::ranges::all_of(
                       skeleton.legs, [&](const Leg& leg) { return IsPlainLeg(skeleton, leg); })) {
    return false;
  }
  std::vector<Vec3> positions;
  std::vector<Quat> rotations;
  for (int f = 0; f < count; ++f) {
    const ConstPoseSpan pose = std::as_const(clip).frame(first_frame + f);
    positions.push_back(pose.root_position_m);
    rotations.push_back(pose.rotations[0]);
  }
  std::vector<double> linear;
  std::vector<double> angular;
  for (std::size_t f = 1; f + 1 < positions.size(); ++f) {
    linear.push_back(clip.fps * clip.fps *
                     glm::length(positions[f + 1] - 2.0f * positions[f] + positions[f - 1]));
    angular.push_back(clip.fps * clip.fps *
                      glm::length(SmallRotation(rotations[f], rotations[f + 1]) -
                                  SmallRotation(rotations[f - 1], rotations[f])));
  }
  if (PercentileOf(linear) < kLeastMPerS2 && PercentileOf(angular) < kLeastRadPerS2) return false;

  std::vector<WorldPose> before(Slot(count), WorldPose(skeleton.joint_count()));
  for (int f = 0; f < count; ++f) {
    WorldPose& world = before[Slot(f)];
    ForwardKinematics(skeleton, std::as_const(clip).frame(first_frame + f), world.positions,
                      world.rotations);
  }
  const std::array<std::vector<int>, 2> to_hip{JointsToHip(skeleton, skeleton.legs[0].hip),
                                               JointsToHip(skeleton, skeleton.legs[1].hip)};
  std::array<std::vector<Vec3>, 2> ankles;
  for (const WorldPose& world : before) {
    for (std::size_t l = 0; l < 2; ++l) {
      ankles[l].push_back(world.positions[Slot(skeleton.legs[l].ankle)]);
    }
  }
  const GaussianMean mean(clip.fps, count);
  for (int f = 0; f < count; ++f) {
    PoseSpan pose = clip.frame(first_frame + f);
    pose.root_position_m = mean.At(positions, f);
    pose.rotations[0] = mean.At(rotations, f);
    for (std::size_t l = 0; l < 2; ++l) {
      Vec3 hip_m = pose.root_position_m;
      Quat parent = pose.rotations[0];
      for (const int joint : to_hip[l]) {
        hip_m += parent * skeleton.joints[Slot(joint)].offset_m;
        if (joint != skeleton.legs[l].hip) parent = parent * pose.rotations[Slot(joint)];
      }
      PlaceAnkle(skeleton.legs[l], before[Slot(f)], mean.At(ankles[l], f), hip_m, parent, pose);
    }
  }
  std::vector<Quat> track(Slot(count));
  for (int joint = 1; joint < skeleton.joint_count(); ++joint) {
    const bool leads_to_hip = joint == to_hip[0].front() || joint == to_hip[1].front();
    if (skeleton.joints[Slot(joint)].parent != 0 || leads_to_hip) continue;
    for (int f = 0; f < count; ++f) track[Slot(f)] = before[Slot(f)].rotations[Slot(joint)];
    for (int f = 0; f < count; ++f) {
      PoseSpan pose = clip.frame(first_frame + f);
      pose.rotations[Slot(joint)] =
          Normalise(glm::conjugate(pose.rotations[0]) * mean.At(track, f));
    }
  }
  return true;
}

}  // namespace stridewire
