#include "offline/complete/upper_body_chains.h"

#include <algorithm>
#include <cmath>

#include "base/trig.h"
#include "offline/build/pose_error.h"
#include "offline/builtin/figure.h"

namespace stridewire::complete {
namespace {

// Minimum length of an upper arm. Collar bones and shoulder blades are shorter.
constexpr float kUpperArmM = 0.15f;
// Range of the lean of a standing trunk; positive is forward. The trunks of people who walk lean by
// -4 to 10 degrees, and a walk adds about 3 degrees to the lean of the stand pose.
constexpr double kMinLeanRad = -4.0 * builtin::kDegree;
constexpr double kMaxLeanRad = 6.0 * builtin::kDegree;

std::size_t ParentOf(const Skeleton& skeleton, std::size_t joint) {
  return static_cast<std::size_t>(skeleton.joints[joint].parent);
}

DQuat WorldRotation(const Skeleton& skeleton, const PostureSample& sample, std::size_t joint) {
  DQuat rotation = sample.rotations[joint];
  for (int j = skeleton.joints[joint].parent; j >= 0;
       j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
    rotation = sample.rotations[static_cast<std::size_t>(j)] * rotation;
  }
  return rotation;
}

// Returns the joints from the child of `top` down to `joint`, in the order of the hierarchy.
std::vector<std::size_t> ChainBelow(const Skeleton& skeleton, std::size_t top, std::size_t joint) {
  std::vector<std::size_t> chain;
  for (std::size_t j = joint; j != top; j = ParentOf(skeleton, j)) chain.push_back(j);
  std::ranges::reverse(chain);
  return chain;
}

// Returns the nearest joint above both joints. The parent of a joint has a lower index.
std::size_t CommonParent(const Skeleton& skeleton, std::size_t a, std::size_t b) {
  while (a != b) {
    if (a > b) {
      a = ParentOf(skeleton, a);
    } else {
      b = ParentOf(skeleton, b);
    }
  }
  return a;
}

// Returns the forward lean of the line from the root to the neck. Without a head, the line ends
// midway between the shoulders.
double LeanRad(const Skeleton& skeleton, const UpperBodyChains& chains,
               const PostureSample& sample) {
  const Pose pose = ToPose(sample);
  std::vector<Vec3> positions(skeleton.joints.size());
  std::vector<Quat> rotations(skeleton.joints.size());
  ForwardKinematics(skeleton, pose, positions, rotations);
  const Vec3 neck =
      chains.head.empty()
          ? 0.5f * (positions[chains.upper_arms[0].joint] + positions[chains.upper_arms[1].joint])
          : positions[chains.head.front()];
  const DVec3 up(neck - positions[0]);
  return Atan2(up.z, up.y);
}

}  // namespace

UpperBodyChains FindUpperBodyChains(const Skeleton& skeleton, const PostureSample& stand) {
  const Pose pose = ToPose(stand);
  const std::vector<BodyPart> parts = FindBodyParts(skeleton, pose);
  std::vector<Vec3> positions(skeleton.joints.size());
  std::vector<Quat> rotations(skeleton.joints.size());
  ForwardKinematics(skeleton, pose, positions, rotations);
  UpperBodyChains chains;
  std::vector<bool> is_in_arm(skeleton.joints.size(), false);
  for (std::size_t j = 1; j < skeleton.joints.size(); ++j) {
    const std::size_t parent = ParentOf(skeleton, j);
    is_in_arm[j] = is_in_arm[parent];
    if (is_in_arm[j] || parts[parent] != BodyPart::kArms) continue;
    if (glm::length(skeleton.joints[j].offset_m) < kUpperArmM) continue;
    chains.upper_arms.push_back({parent, positions[parent].x > positions[0].x});
    is_in_arm[j] = true;
  }
  if (chains.upper_arms.size() != 2) return {};
  const std::size_t chest =
      CommonParent(skeleton, chains.upper_arms[0].joint, chains.upper_arms[1].joint);
  chains.trunk = ChainBelow(skeleton, 0, chest);
  std::size_t head = chest;
  for (std::size_t j = chest + 1; j < skeleton.joints.size(); ++j) {
    if (parts[j] == BodyPart::kHead && ParentOf(skeleton, j) == head) head = j;
  }
  chains.head = ChainBelow(skeleton, chest, head);
  return chains;
}

void TurnUpperBody(const Skeleton& skeleton, const UpperBodyChains& chains,
                   const PostureSample& reference, const UpperBodyTurn& turn,
                   PostureSample& sample) {
  DQuat above = turn.pelvis * reference.rotations[0];
  sample.rotations[0] = above;
  const auto turn_chain = [&](const std::vector<std::size_t>& chain, const DQuat& from,
                              const DQuat& to) {
    for (std::size_t i = 0; i < chain.size(); ++i) {
      const double share = static_cast<double>(i + 1) / static_cast<double>(chain.size());
      const DQuat world = Blend(from, to, share) * WorldRotation(skeleton, reference, chain[i]);
      sample.rotations[chain[i]] = glm::conjugate(above) * world;
      above = world;
    }
  };
  turn_chain(chains.trunk, turn.pelvis, turn.chest);
  turn_chain(chains.head, chains.trunk.empty() ? turn.pelvis : turn.chest, turn.head);
}

void SwingArm(const Skeleton& skeleton, const UpperBodyChains::UpperArm& arm, double forward_rad,
              PostureSample& sample) {
  const DQuat above = WorldRotation(skeleton, sample, ParentOf(skeleton, arm.joint));
  DQuat& rotation = sample.rotations[arm.joint];
  rotation = glm::conjugate(above) * builtin::RotateX(-forward_rad) * above * rotation;
}

PostureSample LimitLean(const Skeleton& skeleton, const UpperBodyChains& chains,
                        const PostureSample& sample) {
  // Root and lower spine turn less than the chest, so one round does not suffice.
  constexpr int kRounds = 4;
  PostureSample limited = sample;
  if (chains.upper_arms.empty()) return limited;
  double turned_rad = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    const double lean_rad = LeanRad(skeleton, chains, limited);
    const double excess_rad = lean_rad - std::clamp(lean_rad, kMinLeanRad, kMaxLeanRad);
    if (excess_rad == 0.0) break;
    turned_rad -= excess_rad;
    UpperBodyTurn turn;
    turn.pelvis = builtin::RotateX(turned_rad / static_cast<double>(chains.trunk.size() + 1));
    turn.chest = builtin::RotateX(turned_rad);
    TurnUpperBody(skeleton, chains, sample, turn, limited);
  }
  for (const UpperBodyChains::UpperArm& arm : chains.upper_arms) {
    SwingArm(skeleton, arm, turned_rad, limited);
  }
  return limited;
}

}  // namespace stridewire::complete
