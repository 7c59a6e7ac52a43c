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

// Functions that foot_correction-inl.h calls, for double.
template <typename Number>
constexpr Number Constant(double value) {
  return value;
}
template <typename T>
T Select(bool condition, const T& yes, const T& no) {
  return condition ? yes : no;
}
double Min(double a, double b) { return std::min(a, b); }
double Max(double a, double b) { return std::max(a, b); }
double DivideBy(double x, double length) { return x / length; }
double OnePlusTwice(double x) { return 1.0 + 2.0 * x; }
template <typename T>
T AddBoth(const T& base, const T& a, const T& b) {
  return base + (a + b);
}
#define STRIDEWIRE_INLINE inline
#include "runtime/pose/foot_correction-inl.h"
#undef STRIDEWIRE_INLINE

// Returns the time over which planting distributes changes of the root: the duration of the
// movement. If both feet stand throughout, the time is such that the vertical residual of the root
// fades out together with the difference pose (kRootRisePart).
double SpreadTime(const Movement& movement) {
  const auto& feet = movement.feet.feet;
  const bool stands =
      feet[0].release_s == FootTrajectory::kNever && feet[1].release_s == FootTrajectory::kNever;
  return stands ? movement.ease_out_s / kRootRisePart : movement.duration_s();
}

struct Timing {
  double time_s, start_offset_s, duration_s, ease_out_s, extra_turn;

  Timing(const Movement& movement, double at_s)
      : time_s(at_s),
        start_offset_s(movement.start_offset_s),
        duration_s(SpreadTime(movement)),
        ease_out_s(movement.ease_out_s),
        extra_turn(movement.extra_turn_rad) {}
  [[nodiscard]] double OfDuration(double x) const { return x / duration_s; }
  [[nodiscard]] double OfEaseOut(double x) const { return x / ease_out_s; }
};

TrajectoryOf<double, DVec3> TrajectoryFor(const FootPlan& plan, Foot foot) {
  const FootTrajectory& from = plan.foot(foot);
  const FootResidual& residual = plan.residuals[static_cast<std::size_t>(foot)];
  const auto& height = from.height_m;
  const auto& turn = from.turn_rad;
  return {.from = from.from.position_m,
          .to = from.to.position_m,
          .release_offset = from.release_offset_m,
          .release_velocity = from.release_velocity_m_s,
          .land_offset = from.land_offset_m,
          .land_velocity = from.land_velocity_m_s,
          .mid_swing_offset = from.mid_swing_offset_m,
          .height = {height[0], height[1], height[2]},
          .turn = {turn[0], turn[1], turn[2]},
          .level = {from.level_m[0], from.level_m[1], from.level_m[2], from.level_m[3]},
          .residual_offset = residual.offset_m,
          .residual_velocity = residual.offset_m_s,
          .root_shift = from.root_shift_m,
          .from_heading = from.from.heading_rad,
          .to_heading = from.to.heading_rad,
          .release_turn = from.release_turn_rad,
          .root_weight = from.root_weight,
          .residual_turn = residual.turn_rad,
          .residual_turn_s = residual.turn_rad_s,
          .lift = {from.lift_m[0], from.lift_m[1], from.lift_m[2]},
          .residual_over_s = residual.over_s,
          .release_s = from.release_s,
          .land_s = from.land_s,
          .settle_lift = from.settle_lift_m,
          .locks_height = from.locks_height ? 1.0 : 0.0};
}

Quat RotationFromUp(const Vec3& normal) {
  return Normalise(Quat(1.0f + normal.y, normal.z, 0.0f, -normal.x));
}

// Returns the time at which the moving foot of a step is released.
double ReleaseTime(const FootPlan& plan) {
  return std::min(plan.feet[0].release_s, plan.feet[1].release_s);
}

// Returns the part of a foot's correction that also moves the root.
DVec3 RootShare(const FootCorrection& correction) {
  return correction.root_weight * correction.offset_m + correction.root_shift_m;
}

}  // namespace

double SettleLiftShare(double settled) { return SettleLiftShareOf(settled); }

double RootSinkShare(double elapsed) { return RootSinkShareOf(elapsed); }

double LiftShare(std::size_t lift, double swing) { return LiftShareOf(kLiftCurves[lift], swing); }

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
  const auto c =
      CorrectTrajectory<double, DVec3>(Timing(movement, time_s), TrajectoryFor(movement.feet, foot),
                                       blended.ball_m, blended.heading_rad, blended.flatness);
  const auto turned = static_cast<float>(c.turned);
  const auto tilted = static_cast<float>(c.tilted);
  Vec3 normal = (1.0f - turned) * trajectory.normals[0] + turned * trajectory.normals[1];
  normal.x *= tilted;
  normal.z *= tilted;
  return {.offset_m = c.offset,
          .turn_rad = c.turn,
          .free_turn_rad = c.free_turn,
          .normal = normal / std::sqrt(glm::dot(normal, normal)),
          .root_weight = trajectory.root_weight,
          .root_shift_m = c.root_shift};
}

DVec3 FootOffset(const Movement& movement, Foot foot, double time_s, const DVec3& ball_m) {
  return OffsetTrajectory<double, DVec3>(Timing(movement, time_s),
                                         TrajectoryFor(movement.feet, foot), ball_m)
      .offset;
}

FeetCorrection CorrectFeet(const Movement& movement, double time_s, const FeetAt& blended) {
  FeetCorrection corrections;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    corrections.feet[f] = CorrectFoot(movement, foot, time_s, blended[f]);
    corrections.root_m += RootShare(corrections.feet[f]);
  }
  const FootPlan& plan = movement.feet;
  const RootApproach& approach = plan.root_approach;
  const RootResidualOf<double, DVec3> residual = {.offset = plan.root_residual_m,
                                                  .velocity = plan.root_residual_m_s,
                                                  .approach = approach.offset_m,
                                                  .approach_velocity = approach.offset_m_s,
                                                  .approach_over_s = approach.over_s};
  corrections.root_m =
      AddRootResidual<double>(corrections.root_m, Timing(movement, time_s), residual);
  const RootDip& dip = plan.root_dip;
  if (dip.depth_m > 0.0) {
    corrections.root_m.y -= DipAt<double>(
        Timing(movement, time_s), {dip.depth_m, dip.speed_m_s, ReleaseTime(plan), dip.over_s});
  }
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
                  const std::array<FeetCorrection, 2>& planned,
                  const std::array<FeetAt, 2>& blended, Movement& movement) {
  // Maximum speed in m/s at which a standing foot continues to descend. A foot that was faster is
  // slowed down to this speed, so that it does not sink into the ground.
  constexpr double kMaxDescentSpeed = 0.5;
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
      // The ball of a standing foot must stay on its footprint, so its horizontal residual is zero.
      // The residual of the turn affects only a foot whose heel is up.
      residual.offset_m.x = residual.offset_m.z = residual.offset_m_s.x = residual.offset_m_s.z =
          0.0;
      const double velocity_m_s =
          per_s * (blended[1][f].ball_m.y - blended[0][f].ball_m.y + before[0].feet[f].offset_m.y -
                   before[1].feet[f].offset_m.y);
      residual.offset_m_s.y += std::max(0.0, -kMaxDescentSpeed - velocity_m_s);
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
    add(trajectory.land_offset_m, trajectory.lift_m[1]);
    add(trajectory.land_velocity_m_s, residual.turn_rad);
    add(trajectory.mid_swing_offset_m, residual.turn_rad_s);
    add({trajectory.height_m[0], trajectory.height_m[1], trajectory.height_m[2]}, residual.over_s);
    add({trajectory.turn_rad[0], trajectory.turn_rad[1], trajectory.turn_rad[2]},
        trajectory.release_s);
    add(DVec3(trajectory.normals[0]), trajectory.land_s);
    add(DVec3(trajectory.normals[1]), trajectory.lift_m[0]);
    add(residual.offset_m, trajectory.lift_m[2]);
    add(residual.offset_m_s, trajectory.locks_height ? 1.0 : 0.0);
    add(trajectory.root_shift_m, trajectory.settle_lift_m);
    const auto& level_m = trajectory.level_m;
    add({level_m[0], level_m[1], level_m[2]}, level_m[3]);
  }
  add(plan.root_residual_m, movement.extra_turn_rad);
  add(plan.root_residual_m_s, SpreadTime(movement));
  add({movement.start_offset_s, movement.ease_out_s, plan.keeps_above_ground ? 1.0 : 0.0},
      plan.plant_fade_s);
  add(plan.root_approach.offset_m, plan.root_approach.over_s);
  add(plan.root_approach.offset_m_s, 0.0);
  const RootDip& dip = plan.root_dip;
  add({dip.depth_m, dip.speed_m_s, ReleaseTime(plan)}, dip.over_s);
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
