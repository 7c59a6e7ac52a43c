#include "runtime/pose/plant_feet.h"

#include <algorithm>
#include <cmath>

#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/pose_kernels.h"
#include "runtime/skeleton/foot_plant_constants.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

// Cubic Hermite curve with the given values and slopes at both ends of [0, length_s].
DVec3 Hermite(const DVec3& p0, const DVec3& v0, const DVec3& p1, const DVec3& v1, double length_s,
              double t) {
  const double s = std::clamp(t / length_s, 0.0, 1.0);
  const double r = 1.0 - s;
  return (1.0 + 2.0 * s) * r * r * p0 + s * s * (1.0 + 2.0 * r) * p1 +
         length_s * s * r * (r * v0 - s * v1);
}

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

// Fraction of the change in height that is complete, eased from 0 to 1. A foot that steps up rises
// early in the swing; a foot that steps down descends late.
double RiseAt(double swing, double rise_m) {
  const double from = rise_m > 0.0 ? 0.0 : kSinkStart;
  return 1.0 - EaseOut((swing - from) / (1.0 - kSinkStart));
}

// How strongly the heading of a standing foot is locked: fully while the sole is on the ground, not
// at all with the heel up. Seen from above, a foot on its toes is too short to have a heading.
double HeadingLockShare(double flatness) {
  return 1.0 - EaseOut((flatness - kHeelUp) / (kSoleDown - kHeelUp));
}

double AsideAt(double swing) {
  const double x = 4.0 * swing * (1.0 - swing);
  return x * x;
}

Quat RotationFromUp(const Vec3& normal) {
  return Normalise(Quat(1.0f + normal.y, normal.z, 0.0f, -normal.x));
}

// The part of a foot's correction by which the root moves as well.
DVec3 RootShare(const FootCorrection& correction) {
  return correction.root_weight * correction.offset_m + correction.root_shift_m;
}

DVec3 RootResidual(const Movement& movement, double time_s) {
  const FootPlan& plan = movement.feet;
  const double since_s = time_s - movement.start_offset_s;
  const double flat = EaseOut(since_s / kRootShiftS);
  const double rise =
      EaseOut(since_s / std::max(kRootShiftS, kRootRisePart * movement.duration_s()));
  return DVec3(flat, rise, flat) * plan.root_residual_m +
         movement.ease_out_s * EaseOutSlope(since_s / movement.ease_out_s) * plan.root_residual_m_s;
}

}  // namespace

double LiftShare(double swing) {
  return (1.0 - EaseOut(swing / kLiftFade)) * EaseOut((swing - (1.0 - kLiftFade)) / kLiftFade);
}

Quat TurnOf(const FootCorrection& correction) {
  return RotationFromUp(correction.normal) * YawRotation(correction.turn_rad);
}

BlendedFoot FootOf(const LegRig& rig, Foot foot, const DVec3& root_m, const LegPose& leg) {
  const LegRig::Side& side = rig.side(foot);
  return {root_m + DVec3(leg.ball_m), leg.FootHeading(side) - side.toe_out_rad, leg.Flatness(side)};
}

FootCorrection CorrectFoot(const Movement& movement, Foot foot, double time_s,
                           const BlendedFoot& blended) {
  const FootTrajectory& trajectory = movement.feet.foot(foot);
  const double duration_s = movement.duration_s();
  const double swing = SwingAt(trajectory, time_s);
  const bool has_landed = time_s >= trajectory.land_s;
  const bool is_planted = trajectory.IsPlanted(time_s);
  const Footprint& print = has_landed ? trajectory.to : trajectory.from;

  FootCorrection correction;
  if (is_planted) {
    correction.offset_m = print.position_m - blended.ball_m;
  } else {
    correction.offset_m =
        Hermite(trajectory.release_offset_m, trajectory.release_velocity_m_s,
                trajectory.land_offset_m, trajectory.land_velocity_m_s,
                trajectory.land_s - trajectory.release_s, time_s - trajectory.release_s) +
        AsideAt(swing) * trajectory.aside_m;
  }
  const double since_s = time_s - movement.start_offset_s;
  const double settled = 1.0 - EaseOut(since_s / movement.ease_out_s);
  const auto& height = trajectory.height_m;
  const double rise = height[2] - height[1];
  correction.offset_m.y = height[0] + settled * (height[1] - height[0]) +
                          rise * RiseAt(swing, rise) + trajectory.lift_m * LiftShare(swing);

  const auto& turn = trajectory.turn_rad;
  const double turned = 1.0 - EaseOut(swing);
  double free_rad = turn[0] + settled * (turn[1] - turn[0]) + turned * (turn[2] - turn[1]);
  // The extra turn of the body does not rotate a standing foot. During its swing, the foot catches
  // up with the turn that the body will have made by the time it lands.
  const auto extra_turn_at = [&](double at_s) {
    return movement.extra_turn_rad * (1.0 - EaseOut(at_s / duration_s));
  };
  free_rad +=
      extra_turn_at(std::min(trajectory.land_s, duration_s)) * turned - extra_turn_at(time_s);
  const FootResidual& residual = movement.feet.residuals[static_cast<std::size_t>(foot)];
  const double value = EaseOut(since_s / residual.over_s);
  const double slope = residual.over_s * EaseOutSlope(since_s / residual.over_s);
  correction.offset_m += value * residual.offset_m + slope * residual.offset_m_s;
  free_rad += value * residual.turn_rad + slope * residual.turn_rad_s;
  correction.free_turn_rad = free_rad;
  if (is_planted) {
    const double lock_rad = WrapAngle(print.heading_rad - blended.heading_rad - free_rad);
    correction.turn_rad = free_rad + HeadingLockShare(blended.flatness) * lock_rad;
  } else {
    correction.turn_rad = free_rad + (1.0 - turned) * trajectory.release_turn_rad;
  }

  const auto tilted = static_cast<float>(turned);
  const Vec3 normal = (1.0f - tilted) * trajectory.normals[0] + tilted * trajectory.normals[1];
  correction.normal = normal / std::sqrt(glm::dot(normal, normal));
  correction.root_weight = trajectory.root_weight;
  correction.root_shift_m = (1.0 - EaseOut(time_s / duration_s)) * trajectory.root_shift_m;
  return correction;
}

FeetCorrection CorrectFeet(const Movement& movement, double time_s, const FeetAt& blended) {
  FeetCorrection corrections;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    corrections.feet[f] = CorrectFoot(movement, foot, time_s, blended[f]);
    corrections.root_m += RootShare(corrections.feet[f]);
  }
  corrections.root_m += RootResidual(movement, time_s);
  return corrections;
}

FeetCorrection CorrectFeet(const Skeleton& skeleton, const LegRig& rig, const Movement& movement,
                           double time_s, ConstPoseSpan pose) {
  FeetAt blended;
  LegPose leg;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    EvaluateLeg(skeleton, rig, pose, foot, leg);
    blended[static_cast<std::size_t>(foot)] = FootOf(rig, foot, DVec3(pose.root_position_m), leg);
  }
  return CorrectFeet(movement, time_s, blended);
}

void ContinueFrom(const std::array<FeetCorrection, 2>& before,
                  const std::array<FeetCorrection, 2>& planned, Movement& movement) {
  FootPlan& plan = movement.feet;
  const double per_s = 1.0 / kBlendStepS;
  for (std::size_t f = 0; f < 2; ++f) {
    const FootTrajectory& trajectory = plan.feet[f];
    const bool is_planted = trajectory.IsPlanted(movement.start_offset_s);
    const auto turn_of = [&](const FeetCorrection& correction) {
      return is_planted ? correction.feet[f].free_turn_rad : correction.feet[f].turn_rad;
    };
    FootResidual& residual = plan.residuals[f];
    residual.offset_m = before[0].feet[f].offset_m - planned[0].feet[f].offset_m;
    residual.offset_m_s = per_s * ((before[0].feet[f].offset_m - before[1].feet[f].offset_m) -
                                   (planned[1].feet[f].offset_m - planned[0].feet[f].offset_m));
    residual.turn_rad = WrapAngle(turn_of(before[0]) - turn_of(planned[0]));
    residual.turn_rad_s = per_s * (WrapAngle(turn_of(before[0]) - turn_of(before[1])) -
                                   WrapAngle(turn_of(planned[1]) - turn_of(planned[0])));
    residual.over_s = movement.ease_out_s;
    if (is_planted) {
      // A standing foot keeps only its height and the turn it has while its heel is up.
      residual.offset_m.x = residual.offset_m.z = residual.offset_m_s.x = residual.offset_m_s.z =
          0.0;
    } else {
      residual.over_s = trajectory.land_s - movement.start_offset_s;
    }
  }
  // The root follows the residuals of the feet. Its own residual is only the remaining difference.
  std::array<DVec3, 2> root{planned[0].root_m, planned[1].root_m};
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t f = 0; f < 2; ++f) {
      const FootResidual& residual = plan.residuals[f];
      root[i] += planned[i].feet[f].root_weight *
                 (residual.offset_m + static_cast<double>(i) * kBlendStepS * residual.offset_m_s);
    }
  }
  plan.root_residual_m = before[0].root_m - root[0];
  plan.root_residual_m_s = per_s * ((before[0].root_m - before[1].root_m) - (root[1] - root[0]));
}

namespace {

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

// Height by which to raise a foot so that its sole stays above the ground that it leaves and the
// ground that it lands on.
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

std::array<std::size_t, 3> JointsOf(const LegRig::Side& side) {
  const auto joint = [&](int place) {
    return static_cast<std::size_t>(side.chain[static_cast<std::size_t>(place)]);
  };
  return {joint(side.hip), joint(side.knee), joint(side.ankle)};
}

}  // namespace

void ApplyPlantFade(const LegRig& rig, const Movement& movement, double time_s, PoseSpan pose) {
  const FootPlan& plan = movement.feet;
  if (!(time_s < movement.start_offset_s + plan.plant_fade_s)) return;
  const auto part =
      static_cast<float>(EaseOut((time_s - movement.start_offset_s) / plan.plant_fade_s));
  pose.root_position_m += part * plan.plant_fade_root_m;
  for (std::size_t f = 0; f < 2; ++f) {
    const auto joints = JointsOf(rig.sides[f]);
    for (std::size_t i = 0; i < joints.size(); ++i) {
      Quat& rotation = pose.rotations[joints[i]];
      rotation = rotation * SlerpFromIdentity(plan.plant_fade_rotations[f][i], part);
    }
  }
}

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
  DVec3 shift(0.0);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    Side& side = sides[static_cast<std::size_t>(foot)];
    EvaluateLeg(skeleton, rig, pose, foot, side.leg);
    const BlendedFoot blended = FootOf(rig, foot, root, side.leg);
    side.correction = CorrectFoot(movement, foot, time_s, blended);
    side.turn = TurnOf(side.correction);
    if (plan.keeps_above_ground) {
      side.correction.offset_m.y +=
          settled * LiftOutOfGround(plan.foot(foot), time_s, rig.side(foot), side.leg,
                                    blended.ball_m + side.correction.offset_m, side.turn);
    }
    const Vec3 ankle = side.leg.positions_m[static_cast<std::size_t>(rig.side(foot).ankle)];
    side.ankle_m =
        blended.ball_m + side.correction.offset_m + DVec3(side.turn * (ankle - side.leg.ball_m));
    shift += RootShare(side.correction);
  }
  shift += RootResidual(movement, time_s);

  // Lower the root until both legs can reach their ankle targets.
  double lower_m = 0.0;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const Side& side = sides[static_cast<std::size_t>(foot)];
    const LegRig::Side& bones = rig.side(foot);
    const Vec3 hip = side.leg.positions_m[static_cast<std::size_t>(bones.hip)];
    const Vec3 blended = side.leg.positions_m[static_cast<std::size_t>(bones.ankle)] - hip;
    const double length_m = static_cast<double>(bones.thigh_m) + bones.shank_m;
    const double blended_m = std::sqrt(glm::dot(blended, blended));
    const double allowed_m = std::min(SmoothMax(blended_m, kEasyExtension * length_m, kSoftM),
                                      kLongestExtension * length_m);
    const DVec3 reach = side.ankle_m - (root + shift + DVec3(hip));
    const double flat_squared = reach.x * reach.x + reach.z * reach.z;
    const double drop_squared = allowed_m * allowed_m - flat_squared;
    // Lowering the root cannot reach a foot that is too far away horizontally. Limit how far it
    // goes down for such a foot.
    const double deepest_m = 0.5 * length_m;
    const double drop_m = std::sqrt(std::max(drop_squared, deepest_m * deepest_m));
    lower_m = SmoothMax(lower_m, -reach.y - drop_m, kSoftLowerM);
  }
  shift.y -= lower_m;

  pose.root_position_m = Vec3(root + shift);
  const DVec3 moved = DVec3(pose.root_position_m);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const Side& side = sides[static_cast<std::size_t>(foot)];
    const LegRig::Side& bones = rig.side(foot);
    const auto ankle = static_cast<std::size_t>(bones.ankle);
    const auto target = Vec3(side.ankle_m - moved);
    SolveLeg(rig, foot, side.leg, target, side.turn * side.leg.world_rotations[ankle], pose);
  }
  ApplyPlantFade(rig, movement, time_s, pose);
}

void BeginPlantFade(const LegRig& rig, ConstPoseSpan displayed, Movement& movement, PoseSpan pose) {
  FootPlan& plan = movement.feet;
  pose.root_position_m = displayed.root_position_m;
  std::ranges::copy(displayed.rotations, pose.rotations.begin());
  plan.plant_fade_s = movement.ease_out_s;
  plan.plant_fade_root_m = Vec3(0.0f);
  for (auto& leg : plan.plant_fade_rotations) leg.fill(kIdentityQuat);
  PlantFeet(rig, movement, movement.start_offset_s, pose);
  plan.plant_fade_root_m = displayed.root_position_m - pose.root_position_m;
  for (std::size_t f = 0; f < 2; ++f) {
    const auto joints = JointsOf(rig.sides[f]);
    for (std::size_t i = 0; i < joints.size(); ++i) {
      plan.plant_fade_rotations[f][i] =
          glm::conjugate(pose.rotations[joints[i]]) * displayed.rotations[joints[i]];
    }
  }
}

PackedFootPlan PackFootPlan(const Movement& movement) {
  const FootPlan& plan = movement.feet;
  const DVec3& base = movement.base.position_m;
  PackedFootPlan packed{};
  std::size_t at = 0;
  const auto add = [&](const DVec3& v, double w) {
    for (const double value : {v.x, v.y, v.z, w}) packed[at++] = static_cast<float>(value);
  };
  for (std::size_t f = 0; f < 2; ++f) {
    const FootTrajectory& trajectory = plan.feet[f];
    const FootResidual& residual = plan.residuals[f];
    add(trajectory.from.position_m - base, WrapAngle(trajectory.from.heading_rad));
    add(trajectory.to.position_m - base, WrapAngle(trajectory.to.heading_rad));
    add(trajectory.release_offset_m, trajectory.release_turn_rad);
    add(trajectory.release_velocity_m_s, trajectory.root_weight);
    add(trajectory.land_offset_m, trajectory.lift_m);
    add(trajectory.land_velocity_m_s, residual.turn_rad);
    add(trajectory.aside_m, residual.turn_rad_s);
    add({trajectory.height_m[0], trajectory.height_m[1], trajectory.height_m[2]}, residual.over_s);
    add({trajectory.turn_rad[0], trajectory.turn_rad[1], trajectory.turn_rad[2]},
        trajectory.release_s);
    add(DVec3(trajectory.normals[0]), trajectory.land_s);
    add(DVec3(trajectory.normals[1]), 0.0);
    add(residual.offset_m, 0.0);
    add(residual.offset_m_s, 0.0);
    add(trajectory.root_shift_m, 0.0);
  }
  add(plan.root_residual_m, movement.extra_turn_rad);
  add(plan.root_residual_m_s, movement.duration_s());
  add({movement.start_offset_s, movement.ease_out_s, plan.keeps_above_ground ? 1.0 : 0.0},
      plan.plant_fade_s);
  return packed;
}

void PlantFeet(const LegRig& rig, const Movement& movement, double time_s, PoseSpan pose) {
  if (!movement.feet.is_active) return;
  const PackedFootPlan plan = PackFootPlan(movement);
  const DVec3& base = movement.base.position_m;
  kernels::PlantPose(rig, {.plan = plan.data(),
                           .time_s = time_s,
                           .base_m = {base.x, base.y, base.z},
                           .root_m = &pose.root_position_m.x,
                           .rotations = &pose.rotations[0].x});
  ApplyPlantFade(rig, movement, time_s, pose);
}

}  // namespace stridewire
