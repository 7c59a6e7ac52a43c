#include "reference_evaluation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "runtime/pose/cell_weights.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/foot_plant_constants.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

constexpr float kSmallestNorm = 0.1f;

// A row of a grid: one example at one grid point.
struct Row {
  const float* floats;
  const GridLayout& layout;
  [[nodiscard]] Quat rotation(std::size_t j) const { return GridLayout::RotationOf(floats, j); }
  [[nodiscard]] DVec3 position() const { return layout.RootOf(floats).position_m; }
  [[nodiscard]] double yaw() const { return layout.RootOf(floats).yaw_rad; }
};

// A pose in the base frame, with the yaw of the root stored separately.
struct LocalPose {
  std::vector<Quat> rotations;
  DVec3 position{0.0};
  double yaw_rad = 0.0;
};

Row ExampleRow(const MotionGroup& group, const GridLayout& layout, int point, std::size_t example) {
  const auto rows = static_cast<std::size_t>(point) * static_cast<std::size_t>(group.row_count());
  return {&group.grid[(rows + example) * static_cast<std::size_t>(layout.row_floats)], layout};
}

// Blends all examples at all points of a cell in a single sum, so that rotations are normalized
// only once.
LocalPose BlendCell(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                    const CellWeights& cell) {
  LocalPose pose;
  const std::size_t largest = static_cast<std::size_t>(std::ranges::max_element(movement.weights) -
                                                       movement.weights.begin());
  for (std::size_t j = 0; j < static_cast<std::size_t>(layout.joint_count); ++j) {
    const Quat none(0.0f, 0.0f, 0.0f, 0.0f);
    Quat sum = none;
    Quat of_largest = none;
    for (int k = 0; k < cell.count; ++k) {
      const float weight = cell.weights[static_cast<std::size_t>(k)];
      for (std::size_t e = 0; e < movement.weights.size(); ++e) {
        const Quat q = weight * ExampleRow(group, layout, cell.first + k, e).rotation(j);
        sum = sum + movement.weights[e] * q;
        if (e == largest) of_largest = of_largest + q;
      }
    }
    pose.rotations.push_back(
        Normalise(std::sqrt(Dot(sum, sum)) >= kSmallestNorm ? sum : of_largest));
  }
  for (int k = 0; k < cell.count; ++k) {
    for (std::size_t e = 0; e < movement.weights.size(); ++e) {
      const Row row = ExampleRow(group, layout, cell.first + k, e);
      const double weight =
          static_cast<double>(cell.weights[static_cast<std::size_t>(k)]) * movement.weights[e];
      pose.position += weight * row.position();
      pose.yaw_rad += weight * row.yaw();
    }
  }
  return pose;
}

// Catmull-Rom interpolation between the poses at the grid points of a cell. `at(point)` returns the
// pose at a grid point.
template <typename At>
LocalPose Interpolate(const CellWeights& cell, At&& at) {
  std::vector<LocalPose> poses;
  for (int k = 0; k < cell.count; ++k) poses.push_back(at(cell.first + k));
  LocalPose pose;
  for (std::size_t j = 0; j < poses[1].rotations.size(); ++j) {
    Quat sum(0.0f, 0.0f, 0.0f, 0.0f);
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const Quat& q = poses[k].rotations[j];
      const float sign = Dot(poses[1].rotations[j], q) < 0.0f ? -1.0f : 1.0f;
      sum = sum + sign * cell.weights[k] * q;
    }
    pose.rotations.push_back(Normalise(sum));
  }
  for (std::size_t k = 0; k < poses.size(); ++k) {
    pose.position += static_cast<double>(cell.weights[k]) * poses[k].position;
    pose.yaw_rad += static_cast<double>(cell.weights[k]) * poses[k].yaw_rad;
  }
  return pose;
}

void ToWorld(const LocalPose& local, const Movement& movement, double time_s, PoseSpan out) {
  const double yaw_rad =
      local.yaw_rad + movement.extra_turn_rad * (1.0 - EaseOut(time_s / movement.duration_s()));
  out.root_position_m =
      Vec3(movement.base.position_m + RotateYaw(movement.base.heading_rad, local.position));
  std::ranges::copy(local.rotations, out.rotations.begin());
  out.rotations[0] = YawRotation(movement.base.heading_rad + yaw_rad) * out.rotations[0];
}

// Adds the difference pose: M' = f D + M, that is r = r_M slerp(1, r_D, f), plus the term of the
// velocity of D.
void AddDifference(const Movement& movement, double time_s, PoseSpan out) {
  const double s = (time_s - movement.start_offset_s) / movement.ease_out_s;
  if (s >= 1.0) return;
  const auto f = static_cast<float>(EaseOut(s));
  out.root_position_m += f * movement.difference.root_position_m;
  for (std::size_t j = 0; j < out.rotations.size(); ++j) {
    out.rotations[j] = out.rotations[j] * SlerpFromIdentity(movement.difference.rotations[j], f);
  }
  if (!movement.is_inertial) return;
  const PoseVelocity& velocity = movement.difference_velocity;
  const auto seconds = static_cast<float>(movement.ease_out_s * EaseOutSlope(s));
  out.root_position_m += seconds * velocity.root_m_s;
  for (std::size_t j = 0; j < out.rotations.size(); ++j) {
    const Vec3 half = 0.5f * seconds * velocity.joints_rad_s[j];
    out.rotations[j] = out.rotations[j] * Normalise(Quat(1.0f, half.x, half.y, half.z));
  }
}

}  // namespace

void EvaluateMovementByReference(const MotionGroup& group, const GridLayout& layout,
                                 const Movement& movement, double time_s, PoseSpan out) {
  const CellWeights cell =
      CellWeightsAt(movement.warp.GridPosition(time_s), group.grid_point_count);
  ToWorld(BlendCell(group, layout, movement, cell), movement, time_s, out);
  AddDifference(movement, time_s, out);
}

void EvaluateMovementBySampling(const MotionGroup& group, const GridLayout& layout,
                                const Movement& movement, double time_s, PoseSpan out) {
  const CellWeights cell =
      CellWeightsAt(movement.warp.GridPosition(time_s), group.grid_point_count);
  LocalPose sum;
  sum.rotations.resize(out.rotations.size(), Quat(0.0f, 0.0f, 0.0f, 0.0f));
  for (std::size_t e = 0; e < movement.weights.size(); ++e) {
    const float weight = movement.weights[e];
    if (weight == 0.0f) continue;
    const LocalPose pose = Interpolate(cell, [&](int point) {
      const Row row = ExampleRow(group, layout, point, e);
      LocalPose at{.position = row.position(), .yaw_rad = row.yaw()};
      for (std::size_t j = 0; j < out.rotations.size(); ++j) {
        at.rotations.push_back(row.rotation(j));
      }
      return at;
    });
    for (std::size_t j = 0; j < out.rotations.size(); ++j) {
      const Quat& q = pose.rotations[j];
      sum.rotations[j] =
          sum.rotations[j] + (Dot(sum.rotations[j], q) < 0.0f ? -weight : weight) * q;
    }
    sum.position += static_cast<double>(weight) * pose.position;
    sum.yaw_rad += weight * pose.yaw_rad;
  }
  for (Quat& q : sum.rotations) q = Normalise(q);
  ToWorld(sum, movement, time_s, out);
  AddDifference(movement, time_s, out);
}

namespace {

double SmoothMax(double a, double b, double soft_m) {
  const double d = a - b;
  return 0.5 * (a + b + std::sqrt(d * d + soft_m * soft_m));
}

// Elapsed fraction of the foot's swing, 0 before release and 1 after landing.
double SwingAt(const FootTrajectory& trajectory, double time_s) {
  if (time_s <= trajectory.release_s) return 0.0;
  if (time_s >= trajectory.land_s) return 1.0;
  return (time_s - trajectory.release_s) / (trajectory.land_s - trajectory.release_s);
}

// Depth of a sole below the ground plane of a footprint, in metres. Fades to zero with the distance
// between the foot and the footprint.
double DepthBelow(const Footprint& footprint, const Vec3& normal, const LegRig::Side& side,
                  const LegPose& leg, const DVec3& ball, const Quat& turn) {
  const DVec3 print = footprint.position_m;
  const double away_m =
      std::sqrt((ball.x - print.x) * (ball.x - print.x) + (ball.z - print.z) * (ball.z - print.z));
  const double near = EaseOut((away_m - kNearPrintM) / (kFarFromPrintM - kNearPrintM));
  if (near <= 0.0) return 0.0;
  const auto depth_of = [&](const Vec3& point, double rest_m) {
    const DVec3 at = ball + DVec3(turn * (point - leg.ball_m));
    const double ground_m =
        print.y - (normal.x * (at.x - print.x) + normal.z * (at.z - print.z)) / normal.y;
    return ground_m + rest_m / normal.y - at.y;
  };
  const double depth_m =
      std::max({depth_of(leg.ball_m, side.ball_height_m), depth_of(leg.heel_m, side.ball_height_m),
                depth_of(leg.toe_tip_m, side.toe_height_m)});
  return near * SmoothMax(0.0, depth_m, kSoftGroundM);
}

// Returns the height by which to raise a foot so that its sole stays above the ground at the old
// and the new footprint.
double LiftOutOfGround(const FootTrajectory& trajectory, double time_s, const LegRig::Side& side,
                       const LegPose& leg, const DVec3& ball, const Quat& turn) {
  const double second =
      1.0 - EaseOut((SwingAt(trajectory, time_s) - kGroundBlendStart) / kGroundBlendLength);
  double lift_m = 0.0;
  if (second < 1.0) {
    lift_m +=
        (1.0 - second) * DepthBelow(trajectory.from, trajectory.normals[0], side, leg, ball, turn);
  }
  if (second > 0.0)
    lift_m += second * DepthBelow(trajectory.to, trajectory.normals[1], side, leg, ball, turn);
  return lift_m;
}

// Returns by how much the root has to be lower so that a leg reaches its ankle target. `blended_m`
// is the distance from hip to ankle in the blended pose, `reach` the vector from hip to target.
double LowerFor(const LegRig::Side& side, double blended_m, const DVec3& reach) {
  const double length_m = static_cast<double>(side.thigh_m) + side.shank_m;
  const double longest_m = std::min(SmoothMax(blended_m, kEasyExtension * length_m, kSoftM),
                                    kLongestExtension * length_m);
  const double free_m =
      std::min(std::max(blended_m, kFreeExtension * length_m), longest_m - kLeastRoom * length_m);
  // Up to `free_m`, the leg is as long as the distance. Beyond it, its length approaches
  // `longest_m`.
  const double distance_m = glm::length(reach);
  const double excess_m = std::max(distance_m - free_m, 0.0);
  const double allowed_m =
      distance_m - excess_m + excess_m / std::hypot(1.0, excess_m / (longest_m - free_m));
  // Lowering the root does not help to reach a foot that is too far away horizontally. For such a
  // foot, limits how far the root is lowered.
  const double deepest_m = 0.5 * length_m;
  const double flat_squared = reach.x * reach.x + reach.z * reach.z;
  const double drop_m =
      std::sqrt(std::max(allowed_m * allowed_m - flat_squared, deepest_m * deepest_m));
  return std::max(0.0, -reach.y - drop_m);
}

}  // namespace

namespace {

// If the ankle would be flexed too far, returns a rotation of the foot about its ball that raises
// the heel. `knee_m` is the position that the knee would have. Positions are relative to the root.
Quat HeelRise(const LegRig::Side& bones, const Vec3& knee_m, const Vec3& ankle_m,
              const Vec3& ball_m, double share) {
  if (bones.foot_m < kSmallestBoneM) return kIdentityQuat;
  const DVec3 sole = DVec3(ball_m - ankle_m);
  const double cosine = glm::dot(glm::normalize(sole), glm::normalize(DVec3(knee_m - ankle_m)));
  const double excess = (cosine - bones.ankle_limit_cosine) / bones.ankle_limit_sine;
  if (excess <= 0.0) return kIdentityQuat;
  const double grown = excess < kAnkleSoftRad ? excess * excess / (2.0 * kAnkleSoftRad)
                                              : excess - 0.5 * kAnkleSoftRad;
  const double half = 0.5 * kHeelRise * share * grown;
  const double per_flat = half / std::max(std::hypot(sole.x, sole.z), double{kSmallestBoneM});
  return glm::normalize(Quat(1.0f, static_cast<float>(sole.z * per_flat), 0.0f,
                             static_cast<float>(-sole.x * per_flat)));
}

}  // namespace

void PlantFeetByReference(const Skeleton& skeleton, const LegRig& rig, const Movement& movement,
                          double time_s, PoseSpan pose) {
  const FootPlan& plan = movement.feet;
  if (!plan.is_active) return;
  struct Side {
    LegPose leg;
    FootCorrection correction;
    Quat turn = kIdentityQuat;  // Rotation of the foot in world axes.
    DVec3 ankle_m{0.0};         // Target position of the ankle in the world.
  };
  std::array<Side, 2> sides;
  const DVec3 root = DVec3(pose.root_position_m);
  const double settled = plan.plant_fade_s > 0.0
                             ? 1.0 - EaseOut((time_s - movement.start_offset_s) / plan.plant_fade_s)
                             : 1.0;
  // The root moves with the corrections of the feet, and with the lifts that keep them above the
  // ground. The weight of each foot's lift changes gradually.
  const double entering = EaseOut((time_s - movement.start_offset_s) / movement.ease_out_s);
  DVec3 shift = CorrectFeet(skeleton, rig, movement, time_s, pose).root_m;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    Side& side = sides[static_cast<std::size_t>(foot)];
    EvaluateLeg(skeleton, rig, pose, foot, side.leg);
    const BlendedFoot blended = FootOf(rig, foot, root, side.leg);
    side.correction = CorrectFoot(movement, foot, time_s, blended);
    side.turn = TurnOf(side.correction);
    if (plan.keeps_above_ground) {
      const double lift_m =
          settled * LiftOutOfGround(plan.foot(foot), time_s, rig.side(foot), side.leg,
                                    blended.ball_m + side.correction.offset_m, side.turn);
      side.correction.offset_m.y += lift_m;
      const double weight = side.correction.root_weight;
      const double followed_m = lift_m / (1.0 + lift_m / kRootFollowsLiftM);
      shift.y += (weight + entering * (1.0 - 2.0 * weight)) * followed_m;
    }
    const Vec3 ankle = side.leg.positions_m[static_cast<std::size_t>(rig.side(foot).ankle)];
    side.ankle_m =
        blended.ball_m + side.correction.offset_m + DVec3(side.turn * (ankle - side.leg.ball_m));
  }

  // Lower the root until both legs can reach their ankle targets.
  std::array<double, 2> lowers_m;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const Side& side = sides[static_cast<std::size_t>(foot)];
    const LegRig::Side& bones = rig.side(foot);
    const Vec3 hip = side.leg.positions_m[static_cast<std::size_t>(bones.hip)];
    const Vec3 blended = side.leg.positions_m[static_cast<std::size_t>(bones.ankle)] - hip;
    lowers_m[static_cast<std::size_t>(foot)] = LowerFor(
        bones, std::sqrt(glm::dot(blended, blended)), side.ankle_m - (root + shift + DVec3(hip)));
  }
  const double apart_m = lowers_m[0] - lowers_m[1];
  shift.y -= 0.5 * (lowers_m[0] + lowers_m[1] +
                    std::sqrt(apart_m * apart_m + kLowerOverlap * lowers_m[0] * lowers_m[1]));

  pose.root_position_m = Vec3(root + shift);
  const DVec3 moved = DVec3(pose.root_position_m);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const Side& side = sides[static_cast<std::size_t>(foot)];
    const LegRig::Side& bones = rig.side(foot);
    const auto ankle = static_cast<std::size_t>(bones.ankle);
    const auto target = Vec3(side.ankle_m - moved);
    const Quat rotation = side.turn * side.leg.world_rotations[ankle];
    const Quat toes = pose.rotations[static_cast<std::size_t>(bones.chain.back())];
    SolveLeg(rig, foot, side.leg, target, rotation, pose);
    LegPose solved;
    EvaluateLeg(skeleton, rig, pose, foot, solved);
    const auto ball = Vec3(root + DVec3(side.leg.ball_m) + side.correction.offset_m - moved);
    const Quat rise = HeelRise(bones, solved.positions_m[static_cast<std::size_t>(bones.knee)],
                               target, ball, settled);
    if (rise == kIdentityQuat) continue;
    SolveLeg(rig, foot, side.leg, ball - rise * (ball - target), rise * rotation, pose);
    if (bones.has_toe_joint) {
      pose.rotations[static_cast<std::size_t>(bones.chain.back())] =
          glm::conjugate(rise * rotation) * rotation * toes;
    }
  }
  ApplyPlantFade(rig, movement, time_s, pose);
}

}  // namespace stridewire
