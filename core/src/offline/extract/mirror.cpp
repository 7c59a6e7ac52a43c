#include "offline/extract/mirror.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/check.h"
#include "offline/extract/mirror_joints.h"
#include "runtime/skeleton/foot_vector.h"

namespace stridewire {
namespace {

// A joint is rigid if its rotation relative to its parent varies by less than this (root mean
// square).
constexpr double kRigidRad = 0.01;

// A bone and the mirror image of its partner, in the frames of their joints.
struct MirroredBone {
  DVec3 own_m;
  DVec3 image_m;
};

DVec3 Mirrored(const DVec3& v) { return {-v.x, v.y, v.z}; }
// Returns M q M, where M is the reflection x -> -x (SkeletonMirror).
DQuat Mirrored(const DQuat& q) { return {q.w, q.x, -q.y, -q.z}; }

std::vector<DQuat> WorldRotations(const Skeleton& skeleton, ConstPoseSpan pose) {
  std::vector<DQuat> world(skeleton.joints.size());
  world[0] = DQuat(pose.rotations[0]);
  for (std::size_t j = 1; j < world.size(); ++j) {
    world[j] =
        world[static_cast<std::size_t>(skeleton.joints[j].parent)] * DQuat(pose.rotations[j]);
  }
  return world;
}

void SetWorldRotations(const Skeleton& skeleton, std::span<const DQuat> world, PoseSpan pose) {
  for (std::size_t j = 0; j < world.size(); ++j) {
    const int parent = skeleton.joints[j].parent;
    const DQuat local =
        parent < 0 ? world[j] : glm::conjugate(world[static_cast<std::size_t>(parent)]) * world[j];
    pose.rotations[j] = Quat(glm::normalize(local));
  }
}

// Returns the bones of joint `j`: the offsets of its children, its end site, ball and toe tip.
std::vector<MirroredBone> BonesOfJoint(const Skeleton& skeleton, const std::vector<int>& partners,
                                       std::size_t j) {
  const int own = static_cast<int>(j);
  const int partner = partners[j];
  std::vector<MirroredBone> bones;
  const auto add = [&](const Vec3& from, const Vec3& to) {
    bones.push_back({DVec3(from), Mirrored(DVec3(to))});
  };
  for (std::size_t child = j + 1; child < skeleton.joints.size(); ++child) {
    if (skeleton.joints[child].parent != own) continue;
    add(skeleton.joints[child].offset_m,
        skeleton.joints[static_cast<std::size_t>(partners[child])].offset_m);
  }
  std::vector<Vec3> own_sites;
  std::vector<Vec3> partner_sites;
  for (const EndSite& site : skeleton.end_sites) {
    if (site.joint == own) own_sites.push_back(site.offset_m);
    if (site.joint == partner) partner_sites.push_back(site.offset_m);
  }
  // Several end sites of one joint cannot be paired, because they have no names.
  if (own_sites.size() == 1 && partner_sites.size() == 1) add(own_sites[0], partner_sites[0]);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const Leg& leg = skeleton.leg(foot);
    const Leg& other = skeleton.leg(OtherFoot(foot));
    if (leg.ball != own || other.ball != partner) continue;
    add(leg.ball_offset_m, other.ball_offset_m);
    add(leg.toe_tip_offset_m, other.toe_tip_offset_m);
  }
  return bones;
}

bool IsRigid(const Posture& posture, const std::vector<int>& partners, std::size_t j) {
  return j > 0 && posture.is_rigid[j] && posture.is_rigid[static_cast<std::size_t>(partners[j])];
}

// Returns the bones of joint `j` and of the joints that are rigid relative to it, in its frame.
std::vector<MirroredBone> BonesOfBody(const Skeleton& skeleton, const Posture& posture,
                                      const std::vector<int>& partners, std::size_t j) {
  std::vector<MirroredBone> bones = BonesOfJoint(skeleton, partners, j);
  for (std::size_t child = j + 1; child < skeleton.joints.size(); ++child) {
    if (skeleton.joints[child].parent != static_cast<int>(j)) continue;
    if (!IsRigid(posture, partners, child)) continue;
    const DQuat own(posture.mean.rotations[child]);
    const DQuat image =
        Mirrored(DQuat(posture.mean.rotations[static_cast<std::size_t>(partners[child])]));
    for (const MirroredBone& bone : BonesOfBody(skeleton, posture, partners, child)) {
      bones.push_back({own * bone.own_m, image * bone.image_m});
    }
  }
  return bones;
}

// Returns one flag per joint: true if it is the ankle of a foot or below it.
std::vector<bool> JointsOfFoot(const Skeleton& skeleton, Foot foot) {
  std::vector<bool> in_foot(skeleton.joints.size(), false);
  const auto ankle = static_cast<std::size_t>(skeleton.leg(foot).ankle);
  in_foot[ankle] = true;
  for (std::size_t j = ankle + 1; j < in_foot.size(); ++j) {
    in_foot[j] = in_foot[static_cast<std::size_t>(skeleton.joints[j].parent)];
  }
  return in_foot;
}

// Returns the frames of a step in which the sole of the fixed foot is flat on the ground, because
// the other foot swings past it.
FrameRange FlatFrames(const ExtractedExample& step) {
  constexpr double kBegin = 0.25;
  constexpr double kEnd = 0.5;
  const std::vector<double>& keys = step.example.keytimes_s;
  const auto frame_at = [&](double part) {
    return static_cast<int>(
        std::lround((keys[1] + part * (keys[2] - keys[1])) * step.example.clip.fps));
  };
  return {frame_at(kBegin), frame_at(kEnd) + 1};
}

// Adds the world's up direction to `sole_up` of each joint of the standing foot, once for each
// frame of the clip in which that foot is flat. The direction is relative to the joint.
void AddSoles(const Skeleton& skeleton, const ExtractedExample& example,
              std::vector<DVec3>& sole_up) {
  if (!IsStep(example.kind)) return;
  const FrameRange flat = FlatFrames(example);
  const std::vector<bool> in_foot = JointsOfFoot(skeleton, OtherFoot(MovingFoot(example.kind)));
  for (int f = flat.begin; f < flat.end; ++f) {
    const std::vector<DQuat> world = WorldRotations(skeleton, example.example.clip.frame(f));
    for (std::size_t j = 0; j < in_foot.size(); ++j) {
      if (in_foot[j]) sole_up[j] += glm::conjugate(world[j]) * DVec3(0.0, 1.0, 0.0);
    }
  }
}

// Projects the bones of a foot onto the ground, and adds the normal of the sole. `up` and
// `image_up` are the normals in the frames of the bones. They are zero for joints above a foot.
void MirrorFromAbove(const DVec3& up, const DVec3& image_up, std::vector<MirroredBone>& bones) {
  constexpr double kNormalM = 0.1;
  if (up == DVec3(0.0) || image_up == DVec3(0.0)) return;
  for (MirroredBone& bone : bones) {
    bone.own_m -= glm::dot(bone.own_m, up) * up;
    bone.image_m -= glm::dot(bone.image_m, image_up) * image_up;
  }
  bones.push_back({kNormalM * up, kNormalM * image_up});
}

// Returns the rotation from the bones to their images with the smallest squared error. Collinear
// bones do not determine the rotation about their line, so it is taken from `start`. For that
// purpose, each pass also fits the result of the previous pass, with the weight of a 1 cm bone.
DQuat FitTurn(std::span<const MirroredBone> bones, const DQuat& start) {
  constexpr double kStartWeightM2 = 1e-4;
  constexpr int kPasses = 10;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const MirroredBone& bone : bones) {
    sum += Eigen::Vector3d(bone.image_m.x, bone.image_m.y, bone.image_m.z) *
           Eigen::RowVector3d(bone.own_m.x, bone.own_m.y, bone.own_m.z);
  }
  Eigen::Quaterniond turn(start.w, start.x, start.y, start.z);
  for (int pass = 0; pass < kPasses; ++pass) {
    const Eigen::Matrix3d target = sum + kStartWeightM2 * turn.toRotationMatrix();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(target, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign =
        (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
    const Eigen::Matrix3d rotation =
        svd.matrixU() * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
    turn = Eigen::Quaterniond(rotation).normalized();
  }
  return {turn.w(), turn.x(), turn.y(), turn.z()};
}

}  // namespace

Posture MeasurePosture(const Skeleton& skeleton,
                       std::span<const ExtractedExample* const> examples) {
  const std::size_t joints = skeleton.joints.size();
  std::vector<DQuat> sums(joints, DQuat(0.0, 0.0, 0.0, 0.0));
  double count = 0.0;
  Posture posture{.mean = Pose(skeleton.joint_count()),
                  .is_rigid = std::vector<bool>(joints, false),
                  .sole_up = std::vector<DVec3>(joints, DVec3(0.0))};
  for (const ExtractedExample* example : examples) {
    const Clip& clip = example->example.clip;
    const double last = std::max(1, clip.frame_count() - 1);
    for (int f = 0; f < clip.frame_count(); ++f) {
      const ConstPoseSpan pose = clip.frame(f);
      const DQuat to_heading(YawRotation(-example->example.heading_change_rad * f / last));
      for (std::size_t j = 0; j < joints; ++j) {
        const DQuat q = j == 0 ? to_heading * DQuat(pose.rotations[0]) : DQuat(pose.rotations[j]);
        sums[j] = glm::dot(sums[j], q) < 0.0 ? sums[j] - q : sums[j] + q;
      }
      count += 1.0;
    }
    AddSoles(skeleton, *example, posture.sole_up);
  }
  for (std::size_t j = 0; j < joints; ++j) {
    const double length = glm::length(sums[j]);
    if (length > 0.0) posture.mean.rotations[j] = Quat(sums[j] / length);
    // The mean of unit quaternions that differ by small angles is shorter than 1 by an eighth of
    // the mean square angle.
    posture.is_rigid[j] = count - length < 0.125 * kRigidRad * kRigidRad * count;
    if (posture.sole_up[j] != DVec3(0.0)) posture.sole_up[j] = glm::normalize(posture.sole_up[j]);
  }
  return posture;
}

std::optional<SkeletonMirror> FindSkeletonMirror(const Skeleton& skeleton, const Posture& posture) {
  std::optional<std::vector<int>> partners = FindMirrorJoints(skeleton, posture.mean);
  if (!partners) return std::nullopt;
  SkeletonMirror mirror{.partners = std::move(*partners), .turns = {}};
  for (std::size_t j = 0; j < skeleton.joints.size(); ++j) {
    const auto partner = static_cast<std::size_t>(mirror.partners[j]);
    const int parent = skeleton.joints[j].parent;
    const DQuat above =
        parent < 0 ? DQuat(1.0, 0.0, 0.0, 0.0) : mirror.turns[static_cast<std::size_t>(parent)];
    // With this turn, mirroring does not change the joint's mean rotation relative to its parent.
    const DQuat keeps_mean = Mirrored(glm::conjugate(DQuat(posture.mean.rotations[partner]))) *
                             above * DQuat(posture.mean.rotations[j]);
    if (IsRigid(posture, mirror.partners, j)) {
      mirror.turns.push_back(glm::normalize(keeps_mean));
      continue;
    }
    std::vector<MirroredBone> bones = BonesOfBody(skeleton, posture, mirror.partners, j);
    MirrorFromAbove(posture.sole_up[j], Mirrored(posture.sole_up[partner]), bones);
    mirror.turns.push_back(FitTurn(bones, keeps_mean));
  }
  return mirror;
}

ExtractedExample MirrorExample(const Skeleton& skeleton, const SkeletonMirror& mirror,
                               std::span<const ParameterName> names,
                               const ExtractedExample& source) {
  STRIDEWIRE_CHECK(names.size() == source.example.parameters.size());
  STRIDEWIRE_CHECK(mirror.partners.size() == skeleton.joints.size());
  STRIDEWIRE_CHECK(source.example.clip.joint_count == skeleton.joint_count());
  ExtractedExample out = source;
  out.example.mirrored = !source.example.mirrored;
  out.example.heading_change_rad = -source.example.heading_change_rad;
  if (IsStep(source.kind)) out.kind = StepKind(OtherFoot(MovingFoot(source.kind)));
  std::swap(out.ground_m[0], out.ground_m[1]);
  Clip& clip = out.example.clip;
  std::vector<DQuat> mirrored(skeleton.joints.size());
  for (int f = 0; f < clip.frame_count(); ++f) {
    const ConstPoseSpan from = source.example.clip.frame(f);
    const PoseSpan to = clip.frame(f);
    to.root_position_m.x = -from.root_position_m.x;
    const std::vector<DQuat> world = WorldRotations(skeleton, from);
    for (std::size_t j = 0; j < mirrored.size(); ++j) {
      mirrored[j] = Mirrored(world[static_cast<std::size_t>(mirror.partners[j])]) * mirror.turns[j];
    }
    SetWorldRotations(skeleton, mirrored, to);
  }
  MakeSignContinuous(clip);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == ParameterName::kTurn) out.example.parameters[i] *= -1.0;
  }
  if (IsStep(out.kind)) MeasureStepParameters(skeleton, names, MovingFoot(out.kind), out.example);
  return out;
}

}  // namespace stridewire
