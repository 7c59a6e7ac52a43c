#include "runtime/library/knee_hinges.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "runtime/skeleton/foot_plant_constants.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

// The joints of a leg without the hip, from the child of the hip to the ankle.
struct LegChain {
  std::vector<std::size_t> joints;
  std::size_t knee = 0;  // Index in `joints`.
};

// Returns an empty chain if the ankle is not below the knee or the knee is not below the hip.
LegChain ChainOf(const Skeleton& skeleton, const Leg& leg) {
  LegChain chain;
  if (leg.hip < 0) return chain;
  for (int j = leg.ankle; j != leg.hip; j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
    if (j < 0) return {};
    chain.joints.push_back(static_cast<std::size_t>(j));
  }
  std::ranges::reverse(chain.joints);
  const auto knee = std::ranges::find(chain.joints, static_cast<std::size_t>(leg.knee));
  if (knee == chain.joints.end()) return {};
  chain.knee = static_cast<std::size_t>(knee - chain.joints.begin());
  return chain;
}

// Returns the normal of the leg's plane in the frame of the hip joint. Its length is the sine of
// the knee's bend. `rotation_of(j)` returns the local rotation of a joint.
template <typename RotationOf>
DVec3 PlaneNormal(const Skeleton& skeleton, const LegChain& chain, const RotationOf& rotation_of) {
  DVec3 position(0.0);
  DVec3 knee(0.0);
  DQuat rotation(1.0, 0.0, 0.0, 0.0);
  for (std::size_t i = 0; i < chain.joints.size(); ++i) {
    const std::size_t joint = chain.joints[i];
    position += rotation * DVec3(skeleton.joints[joint].offset_m);
    if (i == chain.knee) knee = position;
    rotation = rotation * DQuat(rotation_of(joint));
  }
  const DVec3 shank = position - knee;
  const double scale = std::sqrt(glm::dot(knee, knee) * glm::dot(shank, shank));
  return scale > 0.0 ? glm::cross(knee, shank) / scale : DVec3(0.0);
}

DVec3 Unit(const DVec3& v) { return v / std::sqrt(glm::dot(v, v)); }

// Returns the axis that points to the left of the foot in the stand pose, in the frame of the hip
// joint.
DVec3 HingeOfStand(const Skeleton& skeleton, ConstPoseSpan stand_pose, Foot foot) {
  const Leg& leg = skeleton.leg(foot);
  std::vector<Vec3> positions(skeleton.joints.size());
  std::vector<Quat> rotations(skeleton.joints.size());
  ForwardKinematics(skeleton, stand_pose, positions, rotations);
  const Vec3 sole = PointPosition(skeleton, stand_pose, leg.ball, leg.toe_tip_offset_m) -
                    positions[static_cast<std::size_t>(leg.ankle)];
  // The stand pose faces +Z.
  const bool has_direction = std::sqrt(sole.x * sole.x + sole.z * sole.z) >= kSmallestBoneM;
  const DVec3 forward = has_direction ? DVec3(sole.x, 0.0, sole.z) : DVec3(0.0, 0.0, 1.0);
  const DVec3 left(forward.z, 0.0, -forward.x);
  return glm::conjugate(DQuat(rotations[static_cast<std::size_t>(leg.hip)])) * Unit(left);
}

// Computes the hinge of one knee from poses.
class HingeLearner {
 public:
  HingeLearner(const Skeleton& skeleton, Foot foot)
      : skeleton_(skeleton), foot_(foot), chain_(ChainOf(skeleton, skeleton.leg(foot))) {}

  [[nodiscard]] bool has_leg() const { return !chain_.joints.empty(); }

  // Adds a pose. `rotation_of(j)` returns the local rotation of a joint.
  template <typename RotationOf>
  void Add(const RotationOf& rotation_of) {
    const DVec3 normal = PlaneNormal(skeleton_, chain_, rotation_of);
    sum_ += std::sqrt(glm::dot(normal, normal)) * normal;
    count_ += 1.0;
  }

  [[nodiscard]] Vec3 Hinge(ConstPoseSpan stand_pose) const {
    const double mean_square_sine = std::sqrt(glm::dot(sum_, sum_)) / std::max(count_, 1.0);
    const bool bends = mean_square_sine >= static_cast<double>(kBentSine) * kBentSine;
    return Vec3(bends ? Unit(sum_) : HingeOfStand(skeleton_, stand_pose, foot_));
  }

 private:
  const Skeleton& skeleton_;
  Foot foot_;
  LegChain chain_;
  DVec3 sum_ = DVec3(0.0);
  double count_ = 0.0;
};

}  // namespace

std::array<Vec3, 2> LearnKneeHinges(const MotionLibrary& library) {
  const auto row_floats = static_cast<std::size_t>(library.layout().row_floats);
  std::array<Vec3, 2> hinges{Vec3(0.0f), Vec3(0.0f)};
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    HingeLearner learner(library.skeleton(), foot);
    if (!learner.has_leg()) continue;
    for (const MotionGroup& group : library.groups()) {
      for (std::size_t row = 0; row < group.grid.size(); row += row_floats) {
        learner.Add(
            [&](std::size_t joint) { return GridLayout::RotationOf(&group.grid[row], joint); });
      }
    }
    hinges[static_cast<std::size_t>(foot)] = learner.Hinge(library.stand_pose());
  }
  return hinges;
}

std::array<Vec3, 2> LearnKneeHinges(const Skeleton& skeleton, ConstPoseSpan stand_pose,
                                    std::span<const Clip* const> clips) {
  std::array<Vec3, 2> hinges{Vec3(0.0f), Vec3(0.0f)};
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    HingeLearner learner(skeleton, foot);
    if (!learner.has_leg()) continue;
    for (const Clip* clip : clips) {
      for (int f = 0; f < clip->frame_count(); ++f) {
        const ConstPoseSpan pose = clip->frame(f);
        learner.Add([&](std::size_t joint) { return pose.rotations[joint]; });
      }
    }
    hinges[static_cast<std::size_t>(foot)] = learner.Hinge(stand_pose);
  }
  return hinges;
}

}  // namespace stridewire
