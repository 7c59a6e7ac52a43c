#include "offline/build/pose_error.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/extract/mirror_joints.h"
#include "runtime/library/keytimes.h"
#include "runtime/pose/evaluate_poses.h"

namespace stridewire {
namespace {

constexpr float kSideMinM = 0.03f;

std::vector<bool> SidedJoints(const Skeleton& skeleton, ConstPoseSpan stand_pose) {
  const auto n = skeleton.joints.size();
  std::vector<bool> sided(n, false);
  if (const auto partners = FindMirrorJoints(skeleton, stand_pose)) {
    for (std::size_t j = 0; j < n; ++j) sided[j] = (*partners)[j] != static_cast<int>(j);
    return sided;
  }
  std::vector<Vec3> positions(n);
  std::vector<Quat> rotations(n);
  ForwardKinematics(skeleton, stand_pose, positions, rotations);
  for (std::size_t j = 1; j < n; ++j) {
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    sided[j] = sided[parent] || std::fabs(positions[j].x - positions[0].x) > kSideMinM;
  }
  return sided;
}

}  // namespace

std::string_view BodyPartName(BodyPart part) {
  constexpr std::string_view kNames[] = {"trunk", "head", "arms", "legs"};
  return kNames[static_cast<std::size_t>(part)];
}

std::vector<BodyPart> FindBodyParts(const Skeleton& skeleton, ConstPoseSpan stand_pose) {
  const auto n = skeleton.joints.size();
  std::vector<BodyPart> parts(n, BodyPart::kTrunk);
  // Joints between root and hip that carry only a leg count as parts of the trunk.
  std::vector<bool> above_hip(n, false);
  for (const Leg& leg : skeleton.legs) {
    for (int j = leg.hip; j > 0; j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
      above_hip[static_cast<std::size_t>(j)] = true;
    }
  }
  const std::vector<bool> sided = SidedJoints(skeleton, stand_pose);
  std::vector<bool> carries_arm(n, false);
  for (std::size_t j = 1; j < n; ++j) {
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    const bool is_hip =
        static_cast<int>(j) == skeleton.legs[0].hip || static_cast<int>(j) == skeleton.legs[1].hip;
    if (is_hip || parts[parent] == BodyPart::kLegs) {
      parts[j] = BodyPart::kLegs;
    } else if (sided[j] && !above_hip[j]) {
      parts[j] = BodyPart::kArms;
      for (int k = static_cast<int>(j); k >= 0;
           k = skeleton.joints[static_cast<std::size_t>(k)].parent) {
        carries_arm[static_cast<std::size_t>(k)] = true;
      }
    }
  }
  for (std::size_t j = 1; j < n; ++j) {
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    if (parts[j] != BodyPart::kTrunk || above_hip[j] || carries_arm[j]) continue;
    // If the arms branch off at the root, the other children of the root still belong to the trunk.
    if (parts[parent] == BodyPart::kHead || (parent != 0 && carries_arm[parent])) {
      parts[j] = BodyPart::kHead;
    }
  }
  return parts;
}

PoseComparison::PoseComparison(const Skeleton& skeleton, ConstPoseSpan stand_pose)
    : skeleton_(skeleton),
      parts_(FindBodyParts(skeleton, stand_pose)),
      rotations_(skeleton.joints.size()) {
  for (auto& positions : positions_) positions.resize(skeleton.joints.size());
}

Expected<PoseError> PoseComparison::Measure(std::span<const Pose> truth,
                                            std::span<const Pose> other) {
  if (truth.empty() || truth.size() != other.size()) {
    return Fail(ErrorCode::kShapeMismatch, "the movements have different numbers of poses");
  }
  PoseError error;
  std::array<double, kBodyPartCount> counts{};
  for (std::size_t p = 0; p < truth.size(); ++p) {
    if (truth[p].rotations.size() != parts_.size() || other[p].rotations.size() != parts_.size()) {
      return Fail(ErrorCode::kShapeMismatch, "a pose has a wrong number of joints", "",
                  static_cast<std::int64_t>(p));
    }
    ForwardKinematics(skeleton_, truth[p], positions_[0], rotations_);
    ForwardKinematics(skeleton_, other[p], positions_[1], rotations_);
    for (std::size_t j = 0; j < parts_.size(); ++j) {
      const auto distance = static_cast<double>(glm::length(positions_[0][j] - positions_[1][j]));
      const auto part = static_cast<std::size_t>(parts_[j]);
      error.mean_m += distance;
      error.part_m[part] += distance;
      counts[part] += 1.0;
      error.max_m = std::max(error.max_m, distance);
    }
  }
  error.mean_m /= static_cast<double>(truth.size() * parts_.size());
  for (std::size_t part = 0; part < counts.size(); ++part) {
    if (counts[part] > 0.0) error.part_m[part] /= counts[part];
  }
  return error;
}

std::vector<Pose> PosesAtGridPoints(const Clip& clip, std::span<const double> keytimes_s,
                                    std::span<const int> cells) {
  Clip continuous = clip;
  MakeSignContinuous(continuous);
  const TimeWarp warp(keytimes_s, cells);
  std::vector<Pose> poses;
  int last = 0;
  STRIDEWIRE_CHECK(keytimes_s.size() == cells.size() + 1);
  for (const int count : cells) last += count;
  for (int p = 0; p <= last; ++p) {
    Pose& pose = poses.emplace_back(clip.joint_count);
    SampleClip(continuous, warp.TimeAt(p), pose);
  }
  return poses;
}

std::vector<Pose> PosesAtGridPoints(const MotionGroup& group, const GridLayout& layout,
                                    std::span<const double> weights) {
  STRIDEWIRE_CHECK(weights.size() == static_cast<std::size_t>(group.example_count));
  Movement movement;
  ApplyWeights(group, weights, movement);
  movement.group = 0;
  GridCache cache(layout);
  std::vector<Pose> poses;
  for (int p = 0; p < group.grid_point_count; ++p) {
    Pose& pose = poses.emplace_back(layout.joint_count);
    EvaluateGridPoint(group, layout, movement, p, cache, pose);
  }
  return poses;
}

}  // namespace stridewire
