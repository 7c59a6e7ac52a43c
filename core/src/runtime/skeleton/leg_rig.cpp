#include "runtime/skeleton/leg_rig.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/trig.h"
#include "runtime/skeleton/foot_plant_constants.h"

namespace stridewire {
namespace {

int PlaceOf(const std::vector<int>& chain, int joint) {
  const auto it = std::find(chain.begin(), chain.end(), joint);
  return it == chain.end() ? -1 : static_cast<int>(it - chain.begin());
}

// Returns the shortest rotation that turns the direction `from` into `to`, without trigonometry.
Quat ShortestArc(const Vec3& from, const Vec3& to) {
  const float scale = std::sqrt(glm::dot(from, from) * glm::dot(to, to));
  const Vec3 axis = glm::cross(from, to);
  return Normalise(Quat(scale + glm::dot(from, to), axis.x, axis.y, axis.z));
}

// Returns the axis of the knee, not normalized. A positive rotation about it moves the shank
// backward. `reference` is the hinge of the knee in world axes.
Vec3 KneeAxis(const Vec3& thigh, const Vec3& shank, const Vec3& reference) {
  const float scale = std::sqrt(glm::dot(thigh, thigh) * glm::dot(shank, shank));
  const Vec3 plane = glm::cross(thigh, shank) / scale;
  const float sine = std::sqrt(glm::dot(plane, plane));
  const float s = std::clamp((kBentSine - sine) / (kBentSine - kStraightSine), 0.0f, 1.0f);
  // If the knee is bent backward, its plane is ignored, and the axis is that of a straight knee.
  const float forward = glm::dot(plane, reference) < 0.0f ? 0.0f : 1.0f;
  const float weight = forward > 0.0f ? s * s * (3.0f - 2.0f * s) : 1.0f;
  return forward * plane + kReferenceWeight * weight * reference;
}

void Copy(const Vec3& from, float (&to)[3]) {
  to[0] = from.x;
  to[1] = from.y;
  to[2] = from.z;
}

std::vector<int> Sorted(std::vector<int> joints) {
  std::ranges::sort(joints);
  return joints;
}

LegRig::Bones BonesOf(const Skeleton& skeleton, Foot foot, const LegRig::Side& side,
                      const std::vector<int>& joints) {
  LegRig::Bones bones;
  bones.count = side.chain.size();
  for (std::size_t i = 0; i < bones.count; ++i) {
    bones.joints[i] = static_cast<std::size_t>(side.chain[i]);
    bones.rig_joints[i] = static_cast<std::size_t>(PlaceOf(joints, side.chain[i]));
    Copy(skeleton.joints[bones.joints[i]].offset_m, bones.offsets_m[i]);
  }
  bones.hip = static_cast<std::size_t>(side.hip);
  bones.knee = static_cast<std::size_t>(side.knee);
  bones.ankle = static_cast<std::size_t>(side.ankle);
  Copy(skeleton.leg(foot).ball_offset_m, bones.ball_m);
  Copy(skeleton.leg(foot).toe_tip_offset_m, bones.toe_tip_m);
  Copy(side.heel_m, bones.heel_m);
  Copy(side.hinge, bones.hinge);
  bones.thigh_m = side.thigh_m;
  bones.shank_m = side.shank_m;
  bones.ball_height_m = static_cast<float>(side.ball_height_m);
  bones.toe_height_m = static_cast<float>(side.toe_height_m);
  bones.toe_out_rad = static_cast<float>(side.toe_out_rad);
  bones.foot_m = static_cast<float>(side.foot_m);
  bones.ankle_limit_cosine = static_cast<float>(side.ankle_limit_cosine);
  bones.ankle_limit_sine = static_cast<float>(side.ankle_limit_sine);
  bones.has_toe_joint = side.has_toe_joint;
  return bones;
}

}  // namespace

LegRig MakeLegRig(const Skeleton& skeleton, ConstPoseSpan stand_pose,
                  const std::array<Vec3, 2>& knee_hinges) {
  LegRig rig;
  rig.is_usable = true;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    LegRig::Side& side = rig.sides[static_cast<std::size_t>(foot)];
    const Leg& leg = skeleton.leg(foot);
    side.hinge = knee_hinges[static_cast<std::size_t>(foot)];
    for (int j = leg.ball; j >= 0; j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
      side.chain.push_back(j);
    }
    std::reverse(side.chain.begin(), side.chain.end());
    side.hip = PlaceOf(side.chain, leg.hip);
    side.knee = PlaceOf(side.chain, leg.knee);
    side.ankle = PlaceOf(side.chain, leg.ankle);
    if (static_cast<int>(side.chain.size()) > kMaxLegChain || side.hip < 1 ||
        side.knee <= side.hip || side.ankle <= side.knee) {
      rig.is_usable = false;
      continue;
    }
    LegPose pose;
    EvaluateLeg(skeleton, rig, stand_pose, foot, pose);
    const auto at = [&](int place) { return pose.positions_m[static_cast<std::size_t>(place)]; };
    side.thigh_m = glm::length(at(side.knee) - at(side.hip));
    side.shank_m = glm::length(at(side.ankle) - at(side.knee));

    side.ball_height_m = static_cast<double>(stand_pose.root_position_m.y) + pose.ball_m.y;
    side.ankle_height_m = static_cast<double>(stand_pose.root_position_m.y) + at(side.ankle).y;
    side.toe_out_rad = pose.FootHeading(side);
    const Vec3 sole = pose.ball_m - at(side.ankle);
    side.foot_m = std::sqrt(static_cast<double>(sole.x) * sole.x + sole.z * sole.z);
    if (std::min(side.thigh_m, side.shank_m) < kSmallestBoneM) {
      rig.is_usable = false;
      continue;
    }
    side.has_toe_joint =
        side.ankle + 2 == static_cast<int>(side.chain.size()) && leg.ball_offset_m == Vec3(0.0f);
    // The angle between a vertical shank and the flat foot has the cosine -sole_drop_m / sole_m.
    const double sole_drop_m = side.ankle_height_m - side.ball_height_m;
    const double sole_m = std::sqrt(sole_drop_m * sole_drop_m + side.foot_m * side.foot_m);
    if (side.foot_m >= kSmallestBoneM) {
      side.ankle_limit_cosine =
          (side.foot_m * kAnkleLimitSine - sole_drop_m * kAnkleLimitCosine) / sole_m;
      side.ankle_limit_sine =
          (side.foot_m * kAnkleLimitCosine + sole_drop_m * kAnkleLimitSine) / sole_m;
    }
    const Vec3 toes = pose.toe_tip_m - pose.ball_m;
    side.toe_m = std::sqrt(static_cast<double>(toes.x) * toes.x + toes.z * toes.z);
    side.toe_height_m = static_cast<double>(stand_pose.root_position_m.y) + pose.toe_tip_m.y;
    // If the ball coincides with the ankle, the foot has no direction, so the heel is placed
    // directly below the ankle.
    const Vec3 behind = side.foot_m < kSmallestBoneM
                            ? Vec3(0.0f)
                            : static_cast<float>(-kSoleBehindAnkleM / side.foot_m) * sole;
    side.heel_m = glm::conjugate(pose.world_rotations[static_cast<std::size_t>(side.ankle)]) *
                  Vec3(behind.x, sole.y, behind.z);
  }
  if (rig.is_usable) {
    std::ranges::set_union(Sorted(rig.sides[0].chain), Sorted(rig.sides[1].chain),
                           std::back_inserter(rig.joints));
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      rig.bones[static_cast<std::size_t>(foot)] =
          BonesOf(skeleton, foot, rig.side(foot), rig.joints);
    }
  }
  return rig;
}

double LegPose::FootHeading(const LegRig::Side& side) const {
  const Vec3 foot = ball_m - positions_m[static_cast<std::size_t>(side.ankle)];
  return Atan2(foot.x, foot.z);
}

double LegPose::Flatness(const LegRig::Side& side) const {
  if (side.foot_m < kSmallestBoneM) return 0.0;
  const Vec3 foot = ball_m - positions_m[static_cast<std::size_t>(side.ankle)];
  return std::sqrt(static_cast<double>(foot.x) * foot.x + foot.z * foot.z) / side.foot_m;
}

// The toes bend by this much before they lift the foot.
constexpr double kSoftToeM = 0.005;

double LegPose::LowestSole(const LegRig::Side& side) const {
  const double ankle_m = positions_m[static_cast<std::size_t>(side.ankle)].y;
  return std::min({ball_m.y - side.ball_height_m, ankle_m - side.ankle_height_m,
                   toe_tip_m.y - side.toe_height_m + kSoftToeM});
}

void EvaluateLeg(const Skeleton& skeleton, const LegRig& rig, ConstPoseSpan pose, Foot foot,
                 LegPose& out) {
  const std::vector<int>& chain = rig.side(foot).chain;
  out.positions_m[0] = Vec3(0.0f);
  out.world_rotations[0] = pose.rotations[0];
  for (std::size_t i = 1; i < chain.size(); ++i) {
    const auto joint = static_cast<std::size_t>(chain[i]);
    out.positions_m[i] =
        out.positions_m[i - 1] + out.world_rotations[i - 1] * skeleton.joints[joint].offset_m;
    out.world_rotations[i] = out.world_rotations[i - 1] * pose.rotations[joint];
  }
  const std::size_t last = chain.size() - 1;
  const Leg& leg = skeleton.leg(foot);
  out.ball_m = out.positions_m[last] + out.world_rotations[last] * leg.ball_offset_m;
  out.toe_tip_m = out.positions_m[last] + out.world_rotations[last] * leg.toe_tip_offset_m;
  const auto ankle = static_cast<std::size_t>(rig.side(foot).ankle);
  out.heel_m = out.positions_m[ankle] + out.world_rotations[ankle] * rig.side(foot).heel_m;
}

void SolveLeg(const LegRig& rig, Foot foot, const LegPose& leg, const Vec3& ankle_m,
              const Quat& ankle_rotation, PoseSpan pose) {
  const LegRig::Side& side = rig.side(foot);
  const auto hip = static_cast<std::size_t>(side.hip);
  const auto knee = static_cast<std::size_t>(side.knee);
  const auto ankle = static_cast<std::size_t>(side.ankle);
  const Vec3 thigh = leg.positions_m[knee] - leg.positions_m[hip];
  const Vec3 shank = leg.positions_m[ankle] - leg.positions_m[knee];
  const float l1 = side.thigh_m;
  const float l2 = side.shank_m;

  const Vec3 reach = ankle_m - leg.positions_m[hip];
  const float distance = std::sqrt(glm::dot(reach, reach));
  const Vec3 u = distance > 1e-6f ? reach / distance : Vec3(0.0f, -1.0f, 0.0f);
  const float shortest = std::fabs(l1 - l2) + 1e-3f * (l1 + l2);
  const float d = std::clamp(distance, shortest, kMaxLegExtension * (l1 + l2));

  // The knee is at distance `a` along the line from hip to ankle and at distance `h` off that line,
  // in the plane of the leg.
  const float a = (l1 * l1 - l2 * l2 + d * d) / (2.0f * d);
  const float h = std::sqrt(std::max(0.0f, l1 * l1 - a * a));
  Vec3 pole = glm::cross(u, KneeAxis(thigh, shank, leg.world_rotations[hip] * side.hinge));
  const float pole_length = std::sqrt(glm::dot(pole, pole));
  // If a leg points along its own knee axis, it has no plane, so any direction can be used.
  pole = pole_length > 1e-6f ? pole / pole_length : Vec3(0.0f, 0.0f, 1.0f);
  const Vec3 new_thigh = a * u + h * pole;
  const Vec3 new_shank = d * u - new_thigh;

  const Quat turn_thigh = ShortestArc(thigh, new_thigh);
  const Quat turn_shank = ShortestArc(turn_thigh * shank, new_shank) * turn_thigh;
  const Quat before_hip = leg.world_rotations[hip - 1];
  const Quat before_knee = turn_thigh * leg.world_rotations[knee - 1];
  const Quat before_ankle = turn_shank * leg.world_rotations[ankle - 1];
  const auto set = [&](std::size_t place, const Quat& parent, const Quat& world) {
    pose.rotations[static_cast<std::size_t>(side.chain[place])] =
        Normalise(glm::conjugate(parent) * world);
  };
  set(hip, before_hip, turn_thigh * leg.world_rotations[hip]);
  set(knee, before_knee, turn_shank * leg.world_rotations[knee]);
  set(ankle, before_ankle, ankle_rotation);
}

}  // namespace stridewire
